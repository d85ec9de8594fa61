// Answers rows by a file as fuzzylite 6 does, with another bound for "equal" than 1e-6.
#include <cstdio>
#include <cstdlib>
#include <fl/Headers.h>
#include <memory>
#include <string>

int main(int count, char** words) {
    if (count != 3)
        return 2;
    const std::string path = words[1], kind = path.substr(path.rfind('.') + 1);
    std::unique_ptr<fl::Engine> engine;
    if (kind == "fll")
        engine.reset(fl::FllImporter().fromFile(path));
    else if (kind == "fcl")
        engine.reset(fl::FclImporter().fromFile(path));
    else
        engine.reset(fl::FisImporter().fromFile(path));
    fl::fuzzylite::setMachEps(std::atof(words[2])); // files need the usual one
    double value;
    for (std::size_t place = 0; std::scanf("%lf", &value) == 1;) {
        engine->getInputVariable(place)->setValue(value);
        place = (place + 1) % engine->numberOfInputVariables();
        if (place != 0)
            continue;
        engine->process();
        for (std::size_t k = 0; k < engine->numberOfOutputVariables(); ++k)
            std::printf("%.17g ", engine->getOutputVariable(k)->getValue());
        std::printf("\n");
    }
    return 0;
}

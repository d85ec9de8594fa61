// Answers rows in a loop with fuzzylite, one after another, and prints nanoseconds.
//   engines MODEL.fll ROWS.bin INPUTS ROWS ROUNDS ANSWERS.bin
// ROWS.bin and ANSWERS.bin hold doubles, row by row. A line for each round.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include <fl/Headers.h>

int main(int count, char** words) {
    if (count != 7) return 2;
    const int inputs = std::atoi(words[3]), rows = std::atoi(words[4]);
    const int rounds = std::atoi(words[5]);
    std::vector<double> values(static_cast<size_t>(inputs) * rows), answers(rows);
    FILE* file = std::fopen(words[2], "rb");
    if (!file || std::fread(values.data(), 8, values.size(), file) != values.size())
        return 2;
    std::fclose(file);
    fl::Engine* engine = fl::FllImporter().fromFile(words[1]);
    fl::OutputVariable* output = engine->getOutputVariable(0);
    for (int round = 0; round < rounds; ++round) {
        const auto start = std::chrono::steady_clock::now();
        for (int row = 0; row < rows; ++row) {
            for (int k = 0; k < inputs; ++k)
                engine->getInputVariable(k)->setValue(values[row * inputs + k]);
            engine->process();
            answers[row] = output->getValue();
        }
        const auto end = std::chrono::steady_clock::now();
        std::printf("%lld\n", static_cast<long long>(
            std::chrono::duration_cast<std::chrono::nanoseconds>(end - start).count()));
    }
    file = std::fopen(words[6], "wb");
    std::fwrite(answers.data(), 8, answers.size(), file);
    std::fclose(file);
    delete engine;
    return 0;
}

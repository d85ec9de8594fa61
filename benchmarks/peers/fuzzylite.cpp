// Answers rows in a loop with fuzzylite, one after another; compiled as a library.
#include <cstddef>

#include <fl/Headers.h>

extern "C" void* open_engine(const char* text) {
    try {
        return fl::FllImporter().fromString(text);
    } catch (const std::exception&) {
        return nullptr;
    }
}

// `values` and `outputs` have a line for each variable, `rows` doubles each.
extern "C" void infer(void* handle, const double* values, long rows, double* outputs) {
    fl::Engine* engine = static_cast<fl::Engine*>(handle);
    const std::size_t inputs = engine->numberOfInputVariables();
    const std::size_t lines = engine->numberOfOutputVariables();
    for (long row = 0; row < rows; ++row) {
        for (std::size_t k = 0; k < inputs; ++k)
            engine->getInputVariable(k)->setValue(values[k * rows + row]);
        engine->process();
        for (std::size_t k = 0; k < lines; ++k)
            outputs[k * rows + row] = engine->getOutputVariable(k)->getValue();
    }
}

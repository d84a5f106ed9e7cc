/* `skeleton`: Gaussian functions around the runs, with weights by ridge regression.
 *
 * With u the parameters scaled to -1..1 over the runs and y_0 the mean response,
 *
 *     y(u) = y_0 + sum_r k(|u - u_r|) w_r,    k(d) = exp(-d^2 / (2 length^2)),    (K + ridge I) w = y - y_0
 *
 * and the leave-one-out residual of run r is w_r / ((K + ridge I)^-1)_rr (Rippa, Adv. Comput. Math. 11 (1999) 193).
 */
#include "lacuna_plugin.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace {

using lacuna::guard;
using lacuna::say;
using lacuna::wrong_option;

/* ---- the options ---- */

struct Plugin {
    double length = 1.0;

    explicit Plugin(LacunaText options)
    {
        length = lacuna_json_number(lacuna_json(options, "length"), length);
        if (!(length > 0.0 && std::isfinite(length))) {
            throw wrong_option("length", "a number above 0");
        }
    }
};

int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, R"({
    "type": "object",
    "description": "Gaussian functions around the runs, for smooth responses of few parameters.",
    "additionalProperties": false,
    "properties": {
        "length": {
            "type": "number", "exclusiveMinimum": 0, "default": 1.0,
            "description": "Standard deviation of the Gaussian functions, in half ranges of the parameters."
        }
    }
})");
}

int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    return guard(answer, [&] { *out = new Plugin(options); });
}

void destroy(void *plugin)
{
    delete static_cast<Plugin *>(plugin);
}

/* ---- the emulator ---- */

using Numbers = std::vector<double>;

/* The inverse of a positive definite matrix in place, by Gauss and Jordan. */
void invert(Numbers &a, size_t n)
{
    for (size_t k = 0; k < n; ++k) {
        const double pivot = a[k * n + k];
        if (!(pivot > 0.0)) {
            throw std::runtime_error("the kernel matrix is not positive definite: choose a smaller `length`");
        }
        a[k * n + k] = 1.0;
        for (size_t j = 0; j < n; ++j) {
            a[k * n + j] /= pivot;
        }
        for (size_t i = 0; i < n; ++i) {
            const double times = a[i * n + k];
            if (i != k) {
                a[i * n + k] = 0.0;
                for (size_t j = 0; j < n; ++j) {
                    a[i * n + j] -= times * a[k * n + j];
                }
            }
        }
    }
}

/* All numbers lie in one block, which is what `save` answers. */
struct Emulator {
    const size_t dimension, outputs, runs;
    Numbers numbers;
    /* Where in it lie the length of the functions, the range of each parameter, the scaled points, the mean of each
     * output, the weights (runs x outputs), the error of each output and the residuals (runs x outputs). */
    double *length, *centre, *half, *points, *mean_response, *weights, *relative, *residuals;

    Emulator(const Emulator &) = delete;
    /* The counts are floats, as they are saved. */
    Emulator(double d, double o, double r)
        : dimension(static_cast<size_t>(d)), outputs(static_cast<size_t>(o)), runs(static_cast<size_t>(r)),
          numbers(static_cast<size_t>(size(d, o, r)))
    {
        const double counts[] = {d, o, r};
        double *next = std::copy(counts, counts + 3, numbers.data());
        const auto take = [&next](size_t count) { return std::exchange(next, next + count); };
        length = take(1);
        centre = take(dimension);
        half = take(dimension);
        points = take(runs * dimension);
        mean_response = take(outputs);
        weights = take(runs * outputs);
        relative = take(outputs);
        residuals = take(runs * outputs);
    }

    /* The number of all numbers, as a float because it may be large. */
    static double size(double d, double o, double r)
    {
        return 4.0 + (2.0 + r) * d + 2.0 * (1.0 + r) * o;
    }

    void fit(const LacunaTraining &training, double given_length)
    {
        *length = given_length;
        scale(training.points.values);
        Numbers matrix(runs * runs);
        for (size_t i = 0; i < runs; ++i) {
            for (size_t k = 0; k < runs; ++k) {
                matrix[i * runs + k] = kernel(training.points.values + i * dimension, k) + (i == k ? 1e-6 : 0.0);
            }
        }
        invert(matrix, runs);
        for (size_t o = 0; o < outputs; ++o) {
            fit_output(training.responses.values, matrix, o);
        }
    }

    void mean(const double *point, double *values) const
    {
        std::copy_n(mean_response, outputs, values);
        for (size_t r = 0; r < runs; ++r) {
            const double k = kernel(point, r);
            for (size_t o = 0; o < outputs; ++o) {
                values[o] += k * weights[r * outputs + o];
            }
        }
    }

    void jacobian(const double *point, double *out) const
    {
        std::fill_n(out, outputs * dimension, 0.0);
        for (size_t r = 0; r < runs; ++r) {
            const double k = kernel(point, r);
            for (size_t j = 0; j < dimension; ++j) {
                const double slope = -k * apart(point, r, j) / (half[j] * *length);
                for (size_t o = 0; o < outputs; ++o) {
                    out[o * dimension + j] += slope * weights[r * outputs + o];
                }
            }
        }
    }

    /* The difference of a point from a run in one parameter, in lengths. */
    double apart(const double *point, size_t run, size_t j) const
    {
        return ((point[j] - centre[j]) / half[j] - points[run * dimension + j]) / *length;
    }

    double kernel(const double *point, size_t run) const
    {
        double square = 0.0;
        for (size_t j = 0; j < dimension; ++j) {
            square += apart(point, run, j) * apart(point, run, j);
        }
        return std::exp(-0.5 * square);
    }

    void scale(const double *given)
    {
        for (size_t j = 0; j < dimension; ++j) {
            double low = given[j], high = given[j];
            for (size_t i = 1; i < runs; ++i) {
                low = std::min(low, given[i * dimension + j]);
                high = std::max(high, given[i * dimension + j]);
            }
            centre[j] = 0.5 * (low + high);
            half[j] = 0.5 * (high - low);
            if (!(half[j] > 0.0)) {
                throw std::runtime_error("all runs have the same value of parameter " + std::to_string(j + 1));
            }
            for (size_t i = 0; i < runs; ++i) {
                points[i * dimension + j] = (given[i * dimension + j] - centre[j]) / half[j];
            }
        }
    }

    /* Mean, weights and errors of one output. */
    void fit_output(const double *responses, const Numbers &inverse, size_t o)
    {
        const auto y = [=](size_t run) { return responses[run * outputs + o]; };
        double mean = 0.0, spread = 0.0, squares = 0.0;
        for (size_t i = 0; i < runs; ++i) {
            /* About the first run, so that a constant has exactly itself as its mean. */
            mean += (y(i) - y(0)) / static_cast<double>(runs);
        }
        mean += y(0);
        for (size_t i = 0; i < runs; ++i) {
            double weight = 0.0;
            for (size_t k = 0; k < runs; ++k) {
                weight += inverse[i * runs + k] * (y(k) - mean);
            }
            const double left = weight / inverse[i * runs + i];
            weights[i * outputs + o] = weight;
            residuals[i * outputs + o] = left;
            spread += (y(i) - mean) * (y(i) - mean);
            squares += left * left;
        }
        mean_response[o] = mean;
        relative[o] = spread > 0.0 ? squares / spread : 0.0;
    }
};

Emulator &of(void *object)
{
    return *static_cast<Emulator *>(object);
}

void end_emulator(void *object)
{
    delete static_cast<Emulator *>(object);
}

int32_t mean(void *object, LacunaNumbers points, double *values, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const Emulator &e = of(object);
        for (size_t i = 0; i < points.rows; ++i) {
            e.mean(points.values + i * e.dimension, values + i * e.outputs);
        }
    });
}

int32_t jacobian(void *object, LacunaNumbers point, double *out, const LacunaAnswer *answer)
{
    return guard(answer, [&] { of(object).jacobian(point.values, out); });
}

int32_t fit_error(void *object, const LacunaAnswer *answer)
{
    const Emulator &e = of(object);
    lacuna_give(answer, e.relative, 1, e.outputs);
    lacuna_give(answer, e.residuals, e.runs, e.outputs);
    return LACUNA_OK;
}

int32_t save(void *object, const LacunaAnswer *answer)
{
    const Numbers &numbers = of(object).numbers;
    lacuna_say(answer, reinterpret_cast<const char *>(numbers.data()), numbers.size() * sizeof numbers[0]);
    return LACUNA_OK;
}

constexpr LacunaEmulatorFunctions emulator_functions = [] {
    LacunaEmulatorFunctions table{};
    table.size = sizeof table;
    table.destroy = end_emulator;
    table.mean = mean;
    table.jacobian = jacobian;
    table.fit_error = fit_error;
    table.save = save;
    return table;
}();

void hand_over(std::unique_ptr<Emulator> emulator, LacunaEmulator *out)
{
    out->size = sizeof *out;
    out->functions = &emulator_functions;
    out->dimension = emulator->dimension;
    out->outputs = emulator->outputs;
    out->emulator = emulator.release();
}

int32_t load(void *, LacunaText bytes, LacunaEmulator *out, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        double counts[3] = {-1.0, -1.0, -1.0};
        if (bytes.length >= sizeof counts) {
            std::memcpy(counts, bytes.bytes, sizeof counts);
        }
        const auto is_count = [](double x) { return x >= 0.0 && x <= 1e9 && std::floor(x) == x; };
        const auto [dimension, outputs, runs] = counts;
        if (!std::all_of(counts, counts + 3, is_count) ||
            Emulator::size(dimension, outputs, runs) * sizeof(double) != static_cast<double>(bytes.length)) {
            throw std::runtime_error("these bytes are no emulator");
        }
        auto emulator = std::make_unique<Emulator>(dimension, outputs, runs);
        Numbers &numbers = emulator->numbers;
        std::memcpy(numbers.data(), bytes.bytes, bytes.length);
        hand_over(std::move(emulator), out);
    });
}

int32_t fit(void *plugin, const LacunaTraining *training, LacunaKey, const LacunaProgress *progress,
            LacunaEmulator *out, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const LacunaNumbers points = training->points, responses = training->responses;
        if (points.rows < 2 || points.rows != responses.rows) {
            throw std::runtime_error("expected at least two runs, each with a response");
        }
        for (const LacunaNumbers &numbers : {points, responses}) {
            const double *end = numbers.values + numbers.rows * numbers.columns;
            if (!std::all_of(numbers.values, end, [](double x) { return std::isfinite(x); })) {
                throw std::runtime_error("a run has a value that is not finite");
            }
        }
        auto emulator = std::make_unique<Emulator>(points.columns, responses.columns, points.rows);
        emulator->fit(*training, static_cast<const Plugin *>(plugin)->length);
        progress->functions->add(progress->progress, responses.columns);
        hand_over(std::move(emulator), out);
    });
}

/* ---- the library ---- */

constexpr LacunaComponentFunctions component = [] {
    LacunaComponentFunctions table{};
    table.size = sizeof table;
    table.schema = schema;
    table.create = create;
    table.destroy = destroy;
    return table;
}();

constexpr LacunaSurrogateFunctions surrogate = [] {
    LacunaSurrogateFunctions table{};
    table.size = sizeof table;
    table.fit = fit;
    table.load = load;
    return table;
}();

const LacunaEntry entries[] = {LACUNA_ENTRY("surrogate", "skeleton", component, surrogate)};

} // namespace

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("surrogate", "skeleton"), entries);

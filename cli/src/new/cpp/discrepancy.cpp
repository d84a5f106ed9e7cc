/* `skeleton`: independent normal noise with one unknown standard deviation s.
 *
 * The errors that all replicates share add to the variance of the mean curve, once, whatever the number of replicates;
 * their correlation between outputs is left out here (`examples/plugin_c/plain_gaussian.c` of Lacuna's source keeps it).
 * With n_i measured values of output i, their mean y_i, the variance h_i of the shared errors and the response m,
 *
 *     -2 log L = sum_i [ (n_i - 1) log s^2 + log n_i + log v_i + (y_i - m_i)^2 / v_i ] + S / s^2 + n log(2 pi)
 *
 * where v_i = s^2 / n_i + h_i, S is the scatter of the replicates about their means and n the number of values.
 */
#include "lacuna_plugin.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

using lacuna::guard;
using lacuna::say;
using lacuna::string_of;
using lacuna::wrong_option;

/* ---- the options ---- */

struct Plugin {
    /* The scale of the prior; 0 if it follows from the data. */
    double scale = 0.0;

    explicit Plugin(LacunaText options)
    {
        const LacunaText given = lacuna_json(options, "scale");
        scale = lacuna_json_number(given, scale);
        if (given.length > 0 && !(scale > 0.0 && std::isfinite(scale))) {
            throw wrong_option("scale", "a number above 0");
        }
    }
};

int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, R"({
    "type": "object",
    "description": "Independent normal noise with one standard deviation for all outputs. The errors that )"
    R"(all replicates share are added without their correlation between outputs.",
    "additionalProperties": false,
    "properties": {
        "scale": {
            "type": "number", "exclusiveMinimum": 0,
            "description": "Scale of the half-normal prior of the standard deviation, in the unit of the )"
    R"(response. Default: the root mean square of all measured values."
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

/* ---- the likelihood ---- */

/* What it needs of one output: number and mean of the measured values, and the variance of the errors that all
 * replicates share, with and without those that a new replicate does not have. */
struct Output {
    double number = 0.0, mean = 0.0, shared = 0.0, predictive = 0.0;
};

/* A log-likelihood with its derivatives; what it is for a number that is no standard deviation. */
struct Judged {
    std::vector<double> by_response;
    double value = -std::numeric_limits<double>::infinity(), by_deviation = 0.0;
};

class Likelihood {
public:
    Likelihood(const LacunaKnown &known, double scale)
        : scale_(scale), replicates_(known.values.rows), each_(known.values.columns)
    {
        summarise(known);
        add_shared(known);
        unit_ = string_of(lacuna_json(known.about, "layout/unit"));
    }

    const std::vector<Output> &outputs() const { return each_; }
    size_t replicates() const { return replicates_; }

    void say_unknowns(const LacunaAnswer *answer) const
    {
        say(answer, R"([{"name":"deviation","symbol":"s","unit":)" + unit_ + R"(,"prior":{"half_normal":)");
        lacuna_say_number(answer, scale_);
        /* It starts at the median of its prior. */
        say(answer, R"(},"log":true,"start":)");
        lacuna_say_number(answer, 0.6744897501960817 * scale_);
        say(answer, "}]");
    }

    Judged judge(const double *response, double s) const
    {
        Judged judged{std::vector<double>(each_.size())};
        const double variance = s * s;
        if (!(s > 0.0 && variance > 0.0 && std::isfinite(variance))) {
            return judged;
        }
        double twice = scatter_ / variance, slope = scatter_ / variance;
        for (size_t i = 0; i < each_.size(); ++i) {
            const Output &o = each_[i];
            if (o.number == 0.0) {
                continue;
            }
            const double v = variance / o.number + o.shared, gap = o.mean - response[i];
            twice += (o.number - 1.0) * std::log(variance) + std::log(o.number) + std::log(v) + gap * gap / v;
            twice += o.number * std::log(two_pi);
            slope += (gap * gap / v - 1.0) * variance / o.number / v - (o.number - 1.0);
            judged.by_response[i] = gap / v;
        }
        judged.by_deviation = slope / s;
        judged.value = std::isnan(twice) ? judged.value : -0.5 * twice;
        return judged;
    }

private:
    static constexpr double two_pi = 6.283185307179586;

    void summarise(const LacunaKnown &known)
    {
        double squares = 0.0, count = 0.0;
        for (size_t at = 0; at < replicates_ * each_.size(); ++at) {
            if (known.measured[at] == 0) {
                continue;
            }
            /* Welford's recurrence, which loses no digits to a large mean. */
            Output &o = each_[at % each_.size()];
            const double y = known.values.values[at], before = y - o.mean;
            o.number += 1.0;
            o.mean += before / o.number;
            scatter_ += before * (y - o.mean);
            squares += y * y;
            count += 1.0;
        }
        if (count == 0.0) {
            throw std::runtime_error("the measurements hold no value");
        }
        if (!std::isfinite(squares)) {
            throw std::runtime_error("a measured value is not finite");
        }
        if (scale_ == 0.0) {
            scale_ = squares > 0.0 ? std::sqrt(squares / count) : 1.0;
        }
    }

    void add_shared(const LacunaKnown &known)
    {
        for (size_t c = 0; c < known.common_count; ++c) {
            const LacunaCommonErrorView &error = known.common[c];
            if (error.factor.rows != each_.size()) {
                throw std::runtime_error("the shared error `" + string_of(error.origin) + "` has " +
                                         std::to_string(error.factor.rows) + " outputs and not " +
                                         std::to_string(each_.size()));
            }
            for (size_t at = 0; at < error.factor.rows * error.factor.columns; ++at) {
                const double part = error.factor.values[at] * error.factor.values[at];
                Output &o = each_[at / error.factor.columns];
                o.shared += part;
                o.predictive += error.predictive != 0 ? part : 0.0;
            }
        }
    }

    double scale_, scatter_ = 0.0;
    size_t replicates_;
    std::vector<Output> each_;
    std::string unit_; /* JSON */
};

const Likelihood &of(void *object)
{
    return *static_cast<const Likelihood *>(object);
}

void end_likelihood(void *object)
{
    delete static_cast<Likelihood *>(object);
}

int32_t hyperparameters(void *object, const LacunaAnswer *answer)
{
    return guard(answer, [&] { of(object).say_unknowns(answer); });
}

int32_t log_likelihood(void *object, LacunaNumbers responses, LacunaNumbers hyper, double *values,
                       const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        for (size_t i = 0; i < responses.rows; ++i) {
            values[i] = of(object).judge(responses.values + i * responses.columns, hyper.values[i]).value;
        }
    });
}

int32_t gradient(void *object, LacunaNumbers responses, LacunaNumbers hyper, double *by_response, double *by_hyper,
                 const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        for (size_t i = 0; i < responses.rows; ++i) {
            const Judged judged = of(object).judge(responses.values + i * responses.columns, hyper.values[i]);
            by_response = std::copy(judged.by_response.begin(), judged.by_response.end(), by_response);
            by_hyper[i] = judged.by_deviation;
        }
    });
}

int32_t predictive(void *object, LacunaNumbers, LacunaNumbers hyper, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const auto &outputs = of(object).outputs();
        std::vector<double> parts(outputs.size(), hyper.values[0] * hyper.values[0]);
        for (const Output &o : outputs) {
            parts.push_back(o.predictive);
        }
        lacuna_give(answer, parts.data(), 2, outputs.size());
        say(answer, R"(["discrepancy","common"])");
    });
}

/* All that is drawn follows from the key of the call alone. */
int32_t simulate(void *object, LacunaNumbers response, LacunaNumbers hyper, LacunaKey key, double *values,
                 const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const auto &outputs = of(object).outputs();
        LacunaRandom random = lacuna_random(key);
        for (size_t i = 0; i < outputs.size(); ++i) {
            const double centre = response.values[i] + std::sqrt(outputs[i].shared) * lacuna_normal(&random);
            for (size_t r = 0; r < of(object).replicates(); ++r) {
                values[r * outputs.size() + i] = centre + hyper.values[0] * lacuna_normal(&random);
            }
        }
    });
}

/* A few operations for each output: the program may ask often. */
int32_t is_cheap(void *, uint8_t *cheap, const LacunaAnswer *)
{
    *cheap = 1;
    return LACUNA_OK;
}

constexpr LacunaLikelihoodFunctions likelihood_functions = [] {
    LacunaLikelihoodFunctions table{};
    table.size = sizeof table;
    table.destroy = end_likelihood;
    table.hyperparameters = hyperparameters;
    table.log_likelihood = log_likelihood;
    table.gradient = gradient;
    table.predictive = predictive;
    table.simulate = simulate;
    table.is_cheap = is_cheap;
    return table;
}();

int32_t likelihood(void *plugin, const LacunaKnown *known, LacunaLikelihood *out, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        out->size = sizeof *out;
        out->likelihood = new Likelihood(*known, static_cast<const Plugin *>(plugin)->scale);
        out->functions = &likelihood_functions;
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

constexpr LacunaDiscrepancyFunctions discrepancy = [] {
    LacunaDiscrepancyFunctions table{};
    table.size = sizeof table;
    table.likelihood = likelihood;
    return table;
}();

const LacunaEntry entries[] = {LACUNA_ENTRY("discrepancy", "skeleton", component, discrepancy)};

} // namespace

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("discrepancy", "skeleton"), entries);

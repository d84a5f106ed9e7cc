/* `skeleton`: exponential decay, `amplitude exp(-rate t) + background` at any times.
 *
 * The charge of a capacitor, the activity of one isotope, a first-order reaction. The response has one axis, a grid of
 * times in seconds; amplitude and rate are the inputs.
 */
#include "lacuna_plugin.h"

#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

using lacuna::guard;
using lacuna::say;
using lacuna::wrong_option;

/* ---- the options ---- */

struct Plugin {
    double background = 0.0;

    explicit Plugin(LacunaText options)
    {
        background = lacuna_json_number(lacuna_json(options, "background"), background);
        if (!std::isfinite(background)) {
            throw wrong_option("background", "a finite number");
        }
    }
};

int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, R"({
    "type": "object",
    "description": "Exponential decay: `amplitude exp(-rate t) + background` at any times.",
    "additionalProperties": false,
    "properties": {
        "background": {
            "type": "number", "default": 0.0,
            "description": "Value after complete decay, in the unit of the response."
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

/* All options with their defaults, which the record of a run keeps. */
int32_t options(void *plugin, const LacunaAnswer *answer)
{
    lacuna_say_text(answer, R"({"background":)");
    lacuna_say_number(answer, static_cast<const Plugin *>(plugin)->background);
    return lacuna_say_text(answer, "}");
}

/* ---- the model ---- */

/* The inputs, with the amplitude in the unit of the response; the response is that of the study. */
int32_t signature(void *, LacunaText context, const LacunaAnswer *answer)
{
    lacuna_say_text(answer, R"({"inputs":[{"name":"amplitude","default":1.0,"low":null,"high":null,"unit":)");
    lacuna_say_value(answer, lacuna_json(context, "layout/unit"));
    return lacuna_say_text(answer, R"(,"description":"the response at time zero, less the background"},)"
                                   R"({"name":"rate","default":1.0,"low":null,"high":null,"unit":"1/s",)"
                                   R"("description":"the share that decays in a unit of time"}],"resamples":true})");
}

/* The times of the response that is asked for. */
std::vector<double> times(const LacunaCalls &calls)
{
    if (calls.inputs.columns != 2) {
        throw std::runtime_error("expected two inputs, `amplitude` and `rate`");
    }
    const LacunaText axes = lacuna_json(calls.about, "layout/axes"), grid = lacuna_json(axes, "0/coordinates/grid");
    if (lacuna_json_count(axes) != 1 || lacuna_json_is(lacuna_json(axes, "0/name"), "time") == 0 ||
        lacuna_json_is(lacuna_json(grid, "unit"), "s") == 0) {
        throw std::runtime_error("expected a response with one axis, `time` in `s`");
    }
    std::vector<double> t;
    for (LacunaEach each = lacuna_json_each(lacuna_json(grid, "values")); lacuna_json_next(&each) != 0;) {
        t.push_back(lacuna_json_number(each.value, 0.0));
    }
    return t;
}

/* All calls of a batch; the text is a list with `null` for each call that has an answer. What no call can have is an
 * exception, and ends them all. */
int32_t predict(void *plugin, const LacunaCalls *calls, double *responses, int32_t *statuses, uint8_t *valid,
                const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const double background = static_cast<const Plugin *>(plugin)->background;
        const auto t = times(*calls);
        std::string said;
        for (size_t i = 0; i < calls->inputs.rows; ++i) {
            const double *input = calls->inputs.values + 2 * i;
            bool finite = true;
            for (size_t k = 0; k < t.size(); ++k) {
                const double y = input[0] * std::exp(-input[1] * t[k]) + background;
                responses[i * t.size() + k] = y;
                finite = finite && std::isfinite(y);
            }
            valid[i] = 1;
            statuses[i] = finite ? LACUNA_OK : LACUNA_REJECTED;
            said += said.empty() ? "[" : ",";
            said += finite ? "null" : R"({"message":"the response is not finite"})";
        }
        say(answer, said.empty() ? "[]" : said + "]");
    });
}

/* The derivatives of each value (rows) by amplitude and rate (columns). Without a call the question is only whether
 * there are derivatives. */
int32_t jacobian(void *, const LacunaCalls *calls, double *slopes, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        if (calls->inputs.rows == 0) {
            return;
        }
        for (const double t : times(*calls)) {
            const double decayed = std::exp(-calls->inputs.values[1] * t);
            *slopes++ = decayed;
            *slopes++ = -t * calls->inputs.values[0] * decayed;
        }
    });
}

/* Texts are read once a batch, not once a run. */
size_t batch(void *)
{
    return 16;
}

/* ---- the library ---- */

constexpr LacunaComponentFunctions component = [] {
    LacunaComponentFunctions table{};
    table.size = sizeof table;
    table.schema = schema;
    table.create = create;
    table.destroy = destroy;
    table.options = options;
    return table;
}();

constexpr LacunaModelFunctions model = [] {
    LacunaModelFunctions table{};
    table.size = sizeof table;
    table.signature = signature;
    table.predict = predict;
    table.batch = batch;
    table.jacobian = jacobian;
    return table;
}();

const LacunaEntry entries[] = {LACUNA_ENTRY("model", "skeleton", component, model)};

} // namespace

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("model", "skeleton"), entries);

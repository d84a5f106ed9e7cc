/* `skeleton`: a slope of the gain. All values of a curve are multiplied by a factor that is one in its middle and changes
 * linearly along the last axis: with u from -1 at the first point of a curve to 1 at the last,
 *
 *     y -> (1 + slope u) y
 *
 * An amplifier that warms up or an adhesive that creeps.
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
    double deviation = 0.1;

    explicit Plugin(LacunaText options)
    {
        deviation = lacuna_json_number(lacuna_json(options, "deviation"), deviation);
        if (!(deviation > 0.0 && std::isfinite(deviation))) {
            throw wrong_option("deviation", "a number above 0");
        }
    }
};

int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, R"({
    "type": "object",
    "description": "A slope of the gain: all values of a curve are multiplied by a factor that is one in )"
    R"(its middle and changes linearly along the last axis.",
    "additionalProperties": false,
    "properties": {
        "deviation": {
            "type": "number", "exclusiveMinimum": 0, "default": 0.1,
            "description": "The standard deviation of the normal prior of the slope, dimensionless; a slope )"
    R"(of zero means no effect."
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
    lacuna_say_text(answer, R"({"deviation":)");
    lacuna_say_number(answer, static_cast<const Plugin *>(plugin)->deviation);
    return lacuna_say_text(answer, "}");
}

/* ---- the curve ---- */

/* The place u of each value of a curve; zero where the last axis is no grid. */
std::vector<double> places(LacunaText layout)
{
    LacunaText grid{};
    for (LacunaEach axis = lacuna_json_each(lacuna_json(layout, "axes")); lacuna_json_next(&axis) != 0;) {
        grid = lacuna_json(axis.value, "coordinates/grid/values");
    }
    std::vector<double> u;
    for (LacunaEach each = lacuna_json_each(grid); lacuna_json_next(&each) != 0;) {
        u.push_back(lacuna_json_number(each.value, 0.0));
    }
    if (u.empty()) {
        return {0.0};
    }
    const double first = u.front(), half = 0.5 * (u.back() - first);
    for (double &x : u) {
        x = half > 0.0 ? (x - first) / half - 1.0 : 0.0;
    }
    return u;
}

/* One row of values times (constant + slope u); its curves lie one after another. */
void times(const std::vector<double> &u, double constant, double slope, const double *row, size_t count, double *out)
{
    for (size_t j = 0; j < count; ++j) {
        out[j] = (constant + slope * u[j % u.size()]) * row[j];
    }
}

/* ---- the effect ---- */

int32_t describe(void *, const LacunaAnswer *answer)
{
    return say(answer, R"({
    "title": "a slope of the gain: a sensitivity that changes along the curve",
    "formula": "(1 + slope u) y",
    "source": "standard: sensitivity drift of a measuring chain",
    "reach": "any"
})");
}

int32_t parameters(void *plugin, LacunaText, const LacunaAnswer *answer)
{
    const double deviation = static_cast<const Plugin *>(plugin)->deviation;
    lacuna_say_text(answer, R"([{"name":"slope","symbol":"g1","unit":"1","prior":{"normal":[0,)");
    lacuna_say_number(answer, deviation);
    lacuna_say_text(answer, R"(]},"log":false,"start":)");
    lacuna_say_number(answer, deviation);
    return lacuna_say_text(answer, "}]");
}

int32_t absent(void *, LacunaText, const LacunaAnswer *answer)
{
    const double nothing = 0.0;
    lacuna_give(answer, &nothing, 1, 1);
    return LACUNA_OK;
}

/* A fit that starts on either side of zero finds each mode. */
int32_t starts(void *plugin, LacunaText, LacunaText, const LacunaAnswer *answer)
{
    const double deviation = static_cast<const Plugin *>(plugin)->deviation;
    const double both[] = {-deviation, deviation};
    lacuna_give(answer, both, 2, 1);
    return LACUNA_OK;
}

int32_t apply(void *, LacunaText layout, LacunaNumbers responses, LacunaNumbers values, double *changed,
              const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const auto u = places(layout);
        for (size_t i = 0; i < responses.rows; ++i) {
            const size_t at = i * responses.columns;
            times(u, 1.0, values.values[i], responses.values + at, responses.columns, changed + at);
        }
    });
}

int32_t by_parameters(void *, LacunaText layout, LacunaNumbers response, LacunaNumbers, double *jacobian,
                      const LacunaAnswer *answer)
{
    return guard(answer, [&] { times(places(layout), 0.0, 1.0, response.values, response.columns, jacobian); });
}

int32_t push_forward(void *, LacunaText layout, LacunaNumbers, LacunaNumbers values, LacunaNumbers tangents,
                     double *changed, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const auto u = places(layout);
        for (size_t i = 0; i < tangents.rows; ++i) {
            const size_t at = i * tangents.columns;
            times(u, 1.0, values.values[0], tangents.values + at, tangents.columns, changed + at);
        }
    });
}

/* The search for missing effects tries the defaults. */
int32_t proposals(void *, LacunaText, const LacunaAnswer *answer)
{
    return say(answer, "[{}]");
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

constexpr LacunaEffectFunctions effect = [] {
    LacunaEffectFunctions table{};
    table.size = sizeof table;
    table.describe = describe;
    table.parameters = parameters;
    table.absent = absent;
    table.apply = apply;
    table.starts = starts;
    table.by_parameters = by_parameters;
    table.push_forward = push_forward;
    table.proposals = proposals;
    return table;
}();

const LacunaEntry entries[] = {LACUNA_ENTRY("effect", "skeleton", component, effect)};

} // namespace

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("effect", "skeleton"), entries);

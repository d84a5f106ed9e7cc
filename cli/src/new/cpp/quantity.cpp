/* `skeleton`: the crest factor of a curve, its largest magnitude divided by its root mean square.
 *
 * It is the square root of two for a sine and larger for impacts. It is undefined for a curve of zeros.
 */
#include "lacuna_plugin.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>
#include <string_view>

namespace {

using lacuna::guard;
using lacuna::Rejected;
using lacuna::say;
using lacuna::wrong_option;

/* ---- the options ---- */

struct Plugin {
    bool about_mean = false;

    explicit Plugin(LacunaText options)
    {
        const int given = lacuna_json_true(lacuna_json(options, "about_mean"), 0);
        if (given < 0) {
            throw wrong_option("about_mean", "true or false");
        }
        about_mean = given == 1;
    }
};

int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, R"({
    "type": "object",
    "description": "Crest factor: the largest magnitude of a curve divided by its root mean square, or by )"
    R"(that about its mean.",
    "additionalProperties": false,
    "properties": {
        "about_mean": {
            "type": "boolean", "default": false,
            "description": "`true` takes the mean of the values off first."
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
    const bool about_mean = static_cast<const Plugin *>(plugin)->about_mean;
    return say(answer, about_mean ? R"({"about_mean":true})" : R"({"about_mean":false})");
}

/* ---- the quantity ---- */

int32_t unit(void *, const LacunaAnswer *answer)
{
    return say(answer, "1");
}

double crest_factor(const double *y, size_t count, bool about_mean)
{
    const double n = static_cast<double>(count);
    const double mean = about_mean ? std::accumulate(y, y + count, 0.0) / n : 0.0;
    double square = 0.0, peak = 0.0;
    for (size_t i = 0; i < count; ++i) {
        square += (y[i] - mean) * (y[i] - mean) / n;
        peak = std::max(peak, std::abs(y[i] - mean));
    }
    return peak / std::sqrt(square);
}

/* A functional is a copy of the plugin, which may end before it. */
int32_t value(void *functional, LacunaNumbers arguments, double *values, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const bool about_mean = static_cast<const Plugin *>(functional)->about_mean;
        for (size_t i = 0; i < arguments.rows; ++i) {
            values[i] = crest_factor(arguments.values + i * arguments.columns, arguments.columns, about_mean);
        }
    });
}

constexpr LacunaFunctionalFunctions functional_functions = [] {
    LacunaFunctionalFunctions table{};
    table.size = sizeof table;
    table.destroy = destroy;
    table.unit = unit;
    table.value = value;
    return table;
}();

int32_t of_curve(void *, uint8_t *curve, const LacunaAnswer *)
{
    *curve = 1;
    return LACUNA_OK;
}

int32_t bind(void *plugin, LacunaText arguments, LacunaFunctional *out, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        if (lacuna_json_count(lacuna_json(arguments, "curve/grid")) < 2) {
            throw Rejected(R"([{"at":"use","message":"a curve of one point has no crest factor",)"
                           R"("help":["widen the `window`"]}])");
        }
        out->size = sizeof *out;
        out->functional = new Plugin(*static_cast<const Plugin *>(plugin));
        out->functions = &functional_functions;
    });
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

constexpr LacunaQuantityFunctions quantity = [] {
    LacunaQuantityFunctions table{};
    table.size = sizeof table;
    table.of_curve = of_curve;
    table.bind = bind;
    return table;
}();

const LacunaEntry entries[] = {LACUNA_ENTRY("quantity", "skeleton", component, quantity)};

} // namespace

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("quantity", "skeleton"), entries);

/* `skeleton`: a Kronecker sequence, every point a fixed step from the previous one, modulo the unit cube.
 *
 * The steps are the powers 1/g, 1/g^2, ... of the root above one of g^(d + 1) = g + 1: the golden ratio for d = 1.
 *
 * Reference: Roberts, "The unreasonable effectiveness of quasirandom sequences" (2018).
 */
#include "lacuna_plugin.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

namespace {

using lacuna::guard;
using lacuna::say;
using lacuna::wrong_option;

/* ---- the options ---- */

struct Plugin {
    bool random_start = true;

    explicit Plugin(LacunaText options)
    {
        const int given = lacuna_json_true(lacuna_json(options, "random_start"), 1);
        if (given < 0) {
            throw wrong_option("random_start", "true or false");
        }
        random_start = given == 1;
    }
};

int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, R"({
    "type": "object",
    "description": "Kronecker sequence of the generalised golden ratio, for few parameters: a longer design )"
    R"(begins with the shorter one.",
    "additionalProperties": false,
    "properties": {
        "random_start": {
            "type": "boolean", "default": true,
            "description": "`true` starts the sequence at a random point of the cube instead of its centre."
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
    const bool random_start = static_cast<const Plugin *>(plugin)->random_start;
    return say(answer, random_start ? R"({"random_start":true})" : R"({"random_start":false})");
}

/* ---- the points ---- */

/* The points behind the first `known` ones of the sequence. All that is drawn follows from the key alone. */
void place(const Plugin &plugin, size_t known, size_t count, size_t dimension, LacunaKey key, double *points)
{
    LacunaRandom random = lacuna_random(key);
    double g = 2.0;
    /* Each pass reduces the error at least by a factor of three. */
    for (int pass = 0; pass < 60; ++pass) {
        g = std::pow(1.0 + g, 1.0 / (static_cast<double>(dimension) + 1.0));
    }
    for (size_t j = 0; j < dimension; ++j) {
        const double start = plugin.random_start ? lacuna_uniform(&random) : 0.5;
        const double step = std::pow(g, -static_cast<double>(j + 1));
        for (size_t i = 0; i < count; ++i) {
            const double x = start + static_cast<double>(known + i + 1) * step;
            /* The unit cube is open: zero is excluded. */
            points[i * dimension + j] = std::max(x - std::floor(x), std::numeric_limits<double>::epsilon());
        }
    }
}

int32_t points(void *plugin, size_t count, size_t dimension, LacunaKey key, double *out, const LacunaAnswer *answer)
{
    return guard(answer, [&] { place(*static_cast<const Plugin *>(plugin), 0, count, dimension, key, out); });
}

/* The sequence goes on behind its known points: the key is the one that placed them. */
int32_t extend(void *plugin, LacunaText, LacunaNumbers known, size_t count, LacunaKey key, double *out,
               const LacunaAnswer *answer)
{
    return guard(answer,
                 [&] { place(*static_cast<const Plugin *>(plugin), known.rows, count, known.columns, key, out); });
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

constexpr LacunaDesignFunctions design = [] {
    LacunaDesignFunctions table{};
    table.size = sizeof table;
    table.points = points;
    table.extend = extend;
    return table;
}();

const LacunaEntry entries[] = {LACUNA_ENTRY("design", "skeleton", component, design)};

} // namespace

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("design", "skeleton"), entries);

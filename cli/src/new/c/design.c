/* `skeleton`: a Kronecker sequence, every point a fixed step from the previous one, modulo the unit cube.
 *
 * The steps are the powers 1/g, 1/g^2, ... of the root above one of g^(d + 1) = g + 1: the golden ratio for d = 1.
 *
 * Reference: Roberts, "The unreasonable effectiveness of quasirandom sequences" (2018).
 */
#include "lacuna_plugin.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

/* ---- the options ---- */

typedef struct {
    int random_start;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return lacuna_say_text(answer,
        "{\"type\":\"object\",\"description\":\"Kronecker sequence of the generalised golden ratio, for few parameters: "
        "a longer design begins with the shorter one.\",\"additionalProperties\":false,\"properties\":{"
        "\"random_start\":{\"type\":\"boolean\",\"default\":true,\"description\":\"`true` starts the sequence at a "
        "random point of the cube instead of its centre.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    const int random_start = lacuna_json_true(lacuna_json(options, "random_start"), 1);
    Plugin *plugin;
    if (random_start < 0) {
        return lacuna_wrong_option(answer, "random_start", "true or false");
    }
    plugin = malloc(sizeof *plugin);
    if (plugin == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    plugin->random_start = random_start;
    *out = plugin;
    return LACUNA_OK;
}

/* All options with their defaults, which the record of a run keeps. */
static int32_t options(void *plugin, const LacunaAnswer *answer)
{
    const Plugin *p = plugin;
    return lacuna_say_text(answer, p->random_start ? "{\"random_start\":true}" : "{\"random_start\":false}");
}

/* ---- the points ---- */

/* The points after the first `known` ones of the sequence. */
static void place(const Plugin *plugin, size_t known, size_t count, size_t dimension, LacunaKey key, double *points)
{
    /* All that is drawn follows from the key of the call, never from `rand` or a clock. */
    LacunaRandom random = lacuna_random(key);
    double g = 2.0;
    size_t i, j;
    /* Each pass reduces the error at least by a factor of three. */
    for (i = 0; i < 60; ++i) {
        g = pow(1.0 + g, 1.0 / ((double)dimension + 1.0));
    }
    for (j = 0; j < dimension; ++j) {
        const double start = plugin->random_start ? lacuna_uniform(&random) : 0.5;
        const double step = pow(g, -(double)(j + 1));
        for (i = 0; i < count; ++i) {
            const double x = start + (double)(known + i + 1) * step;
            /* The unit cube is open: zero is excluded. */
            points[i * dimension + j] = fmax(x - floor(x), DBL_EPSILON);
        }
    }
}

static int32_t points(void *plugin, size_t count, size_t dimension, LacunaKey key, double *out,
                      const LacunaAnswer *answer)
{
    (void)answer;
    place(plugin, 0, count, dimension, key, out);
    return LACUNA_OK;
}

/* The sequence goes on behind its known points: the key is the one that placed them. */
static int32_t extend(void *plugin, LacunaText parameters, LacunaNumbers known, size_t count, LacunaKey key,
                      double *out, const LacunaAnswer *answer)
{
    (void)parameters;
    (void)answer;
    place(plugin, known.rows, count, known.columns, key, out);
    return LACUNA_OK;
}

/* ---- the library ---- */

static const LacunaComponentFunctions component = {
    .size = sizeof(LacunaComponentFunctions), .schema = schema, .create = create, .destroy = free, .options = options
};

static const LacunaDesignFunctions design = {
    .size = sizeof(LacunaDesignFunctions), .points = points, .extend = extend
};

static const LacunaEntry entries[] = {
    LACUNA_ENTRY("design", "skeleton", component, design)
};

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("design", "skeleton"), entries);

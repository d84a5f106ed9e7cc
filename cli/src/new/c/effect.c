/* `skeleton`: a slope of the gain. All values of a curve are multiplied by a factor that is one in its middle and changes
 * linearly along the last axis: with u from -1 at the first point of a curve to 1 at the last,
 *
 *     y -> (1 + slope u) y
 *
 * An amplifier that warms up or an adhesive that creeps.
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdlib.h>

/* ---- the options ---- */

typedef struct {
    double deviation;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return lacuna_say_text(answer,
        "{\"type\":\"object\",\"description\":\"A slope of the gain: all values of a curve are multiplied by a factor that "
        "is one in its middle and changes linearly along the last axis.\",\"additionalProperties\":false,\"properties\":{"
        "\"deviation\":{\"type\":\"number\",\"exclusiveMinimum\":0,\"default\":0.1,\"description\":\"The standard "
        "deviation of the normal prior of the slope, dimensionless; a slope of zero means no effect.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    const double deviation = lacuna_json_number(lacuna_json(options, "deviation"), 0.1);
    Plugin *plugin;
    if (!(deviation > 0.0) || isinf(deviation)) {
        return lacuna_wrong_option(answer, "deviation", "a number above 0");
    }
    plugin = malloc(sizeof *plugin);
    if (plugin == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    plugin->deviation = deviation;
    *out = plugin;
    return LACUNA_OK;
}

/* All options with their defaults, which the record of a run keeps. */
static int32_t options(void *plugin, const LacunaAnswer *answer)
{
    lacuna_say_text(answer, "{\"deviation\":");
    lacuna_say_number(answer, ((const Plugin *)plugin)->deviation);
    return lacuna_say_text(answer, "}");
}

/* ---- the curve ---- */

/* The place u of each value of a curve, to be freed, and their number; all zero where the last axis is no grid. */
static double *places(LacunaText layout, size_t *count)
{
    LacunaEach axis = lacuna_json_each(lacuna_json(layout, "axes"));
    LacunaText grid = {NULL, 0};
    double *u, first, half;
    size_t i;
    while (lacuna_json_next(&axis)) {
        grid = lacuna_json(axis.value, "coordinates/grid/values");
    }
    u = lacuna_json_numbers(grid, count);
    if (u == NULL || *count == 0) {
        free(u);
        *count = 1;
        return calloc(1, sizeof *u);
    }
    first = u[0];
    half = 0.5 * (u[*count - 1] - first);
    for (i = 0; i < *count; ++i) {
        u[i] = half > 0.0 ? (u[i] - first) / half - 1.0 : 0.0;
    }
    return u;
}

/* Rows of numbers times (constant + slope u), with one slope a row; the curves of a row lie one after another. */
static int32_t times(LacunaText layout, LacunaNumbers rows, double constant, const double *slopes, int one_slope,
                     double *out, const LacunaAnswer *answer)
{
    size_t i, j, count;
    double *u = places(layout, &count);
    if (u == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    for (i = 0; i < rows.rows; ++i) {
        for (j = 0; j < rows.columns; ++j) {
            const double slope = slopes[one_slope ? 0 : i];
            out[i * rows.columns + j] = (constant + slope * u[j % count]) * rows.values[i * rows.columns + j];
        }
    }
    free(u);
    return LACUNA_OK;
}

/* ---- the effect ---- */

static int32_t describe(void *plugin, const LacunaAnswer *answer)
{
    (void)plugin;
    return lacuna_say_text(answer,
        "{\"title\":\"a slope of the gain: a sensitivity that changes along the curve\",\"formula\":\"(1 + slope u) y\","
        "\"source\":\"standard: sensitivity drift of a measuring chain\",\"reach\":\"any\"}");
}

static int32_t parameters(void *plugin, LacunaText layout, const LacunaAnswer *answer)
{
    const double deviation = ((const Plugin *)plugin)->deviation;
    (void)layout;
    lacuna_say_text(answer, "[{\"name\":\"slope\",\"symbol\":\"g1\",\"unit\":\"1\",\"prior\":{\"normal\":[0,");
    lacuna_say_number(answer, deviation);
    lacuna_say_text(answer, "]},\"log\":false,\"start\":");
    lacuna_say_number(answer, deviation);
    return lacuna_say_text(answer, "}]");
}

static int32_t absent(void *plugin, LacunaText layout, const LacunaAnswer *answer)
{
    const double nothing = 0.0;
    (void)plugin;
    (void)layout;
    lacuna_give(answer, &nothing, 1, 1);
    return LACUNA_OK;
}

/* A fit that starts on either side of zero finds each mode. */
static int32_t starts(void *plugin, LacunaText layout, LacunaText situation, const LacunaAnswer *answer)
{
    const double deviation = ((const Plugin *)plugin)->deviation;
    const double both[2] = {-deviation, deviation};
    (void)layout;
    (void)situation;
    lacuna_give(answer, both, 2, 1);
    return LACUNA_OK;
}

static int32_t apply(void *plugin, LacunaText layout, LacunaNumbers responses, LacunaNumbers values, double *changed,
                     const LacunaAnswer *answer)
{
    (void)plugin;
    return times(layout, responses, 1.0, values.values, 0, changed, answer);
}

static int32_t by_parameters(void *plugin, LacunaText layout, LacunaNumbers response, LacunaNumbers values,
                             double *jacobian, const LacunaAnswer *answer)
{
    const double one = 1.0;
    (void)plugin;
    (void)values;
    return times(layout, response, 0.0, &one, 1, jacobian, answer);
}

static int32_t push_forward(void *plugin, LacunaText layout, LacunaNumbers response, LacunaNumbers values,
                            LacunaNumbers tangents, double *changed, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)response;
    return times(layout, tangents, 1.0, values.values, 1, changed, answer);
}

/* The search for missing effects tries the defaults. */
static int32_t proposals(void *plugin, LacunaText situation, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)situation;
    return lacuna_say_text(answer, "[{}]");
}

/* ---- the library ---- */

static const LacunaComponentFunctions component = {
    .size = sizeof(LacunaComponentFunctions), .schema = schema, .create = create, .destroy = free, .options = options
};

static const LacunaEffectFunctions effect = {
    .size = sizeof(LacunaEffectFunctions), .describe = describe, .parameters = parameters, .absent = absent,
    .apply = apply, .starts = starts, .by_parameters = by_parameters, .push_forward = push_forward,
    .proposals = proposals
};

static const LacunaEntry entries[] = {
    LACUNA_ENTRY("effect", "skeleton", component, effect)
};

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("effect", "skeleton"), entries);

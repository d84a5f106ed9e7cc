/* `skeleton`: a slope of the gain. All values of a curve are multiplied by a factor that is one in its middle and changes
 * linearly along the last axis: with u from -1 at the first point of a curve to 1 at the last,
 *
 *     y -> (1 + slope u) y
 *
 * An amplifier that warms up or an adhesive that creeps.
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- texts ---- */

static int32_t say(const LacunaAnswer *answer, int32_t status, const char *text)
{
    lacuna_say(answer, text, strlen(text));
    return status;
}

/* A copy that ends with a zero, to be freed; NULL if there is no memory left. */
static char *copy_of(LacunaText text)
{
    char *copy = malloc(text.length + 1);
    if (copy != NULL) {
        if (text.length > 0) {
            memcpy(copy, text.bytes, text.length);
        }
        copy[text.length] = '\0';
    }
    return copy;
}

/* ---- the options ---- */

typedef struct {
    double deviation;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, LACUNA_OK,
        "{\"type\":\"object\",\"description\":\"A slope of the gain: all values of a curve are multiplied by a factor that "
        "is one in its middle and changes linearly along the last axis.\",\"additionalProperties\":false,\"properties\":{"
        "\"deviation\":{\"type\":\"number\",\"exclusiveMinimum\":0,\"default\":0.1,\"description\":\"The standard "
        "deviation of the normal prior of the slope, dimensionless; a slope of zero means no effect.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    char *text = copy_of(options), *end = NULL;
    const char *at = text == NULL ? NULL : strstr(text, "\"deviation\":");
    Plugin *plugin = malloc(sizeof *plugin);
    int sound = 1;
    if (text == NULL || plugin == NULL) {
        free(text);
        free(plugin);
        return say(answer, LACUNA_STOP, "there is no memory left");
    }
    plugin->deviation = 0.1;
    if (at != NULL) {
        at += strlen("\"deviation\":");
        plugin->deviation = strtod(at, &end);
        sound = end != at && plugin->deviation > 0.0 && !isinf(plugin->deviation);
    }
    free(text);
    if (!sound) {
        free(plugin);
        return say(answer, LACUNA_REJECTED,
            "[{\"at\":\"deviation\",\"message\":\"wrong value for `deviation`\",\"expected\":\"a number above 0\"}]");
    }
    *out = plugin;
    return LACUNA_OK;
}

/* All options with their defaults, which the record of a run keeps. */
static int32_t options(void *plugin, const LacunaAnswer *answer)
{
    char text[64];
    snprintf(text, sizeof text, "{\"deviation\":%.17g}", ((const Plugin *)plugin)->deviation);
    return say(answer, LACUNA_OK, text);
}

/* ---- the curve ---- */

/* The place u of each value of a curve, to be freed, and their number; all zero where the last axis is no grid. */
static double *places(LacunaText layout, size_t *count)
{
    char *text = copy_of(layout);
    const char *at = text, *next = text;
    double *u, half;
    size_t i;
    while (next != NULL && (next = strstr(next, "\"values\":[")) != NULL) {
        next += strlen("\"values\":[");
        at = next;
    }
    if (text == NULL || at == text || strstr(at, "\"labels\":[") != NULL) {
        free(text);
        *count = 1;
        return calloc(1, sizeof *u);
    }
    *count = 1;
    for (i = 0; at[i] != '\0' && at[i] != ']'; ++i) {
        *count += at[i] == ',';
    }
    u = malloc(*count * sizeof *u);
    for (i = 0; u != NULL && i < *count; ++i) {
        char *end;
        u[i] = strtod(at, &end);
        at = end + 1;
    }
    free(text);
    half = u == NULL ? 0.0 : 0.5 * (u[*count - 1] - u[0]);
    for (i = *count; u != NULL && i-- > 0;) {
        u[i] = half > 0.0 ? (u[i] - u[0]) / half - 1.0 : 0.0;
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
        return say(answer, LACUNA_STOP, "there is no memory left");
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
    return say(answer, LACUNA_OK,
        "{\"title\":\"a slope of the gain: a sensitivity that changes along the curve\",\"formula\":\"(1 + slope u) y\","
        "\"source\":\"standard: sensitivity drift of a measuring chain\",\"reach\":\"any\"}");
}

static int32_t parameters(void *plugin, LacunaText layout, const LacunaAnswer *answer)
{
    const double deviation = ((const Plugin *)plugin)->deviation;
    char text[256];
    (void)layout;
    snprintf(text, sizeof text,
        "[{\"name\":\"slope\",\"symbol\":\"g1\",\"unit\":\"1\",\"prior\":{\"normal\":[0,%.17g]},\"log\":false,"
        "\"start\":%.17g}]", deviation, deviation);
    return say(answer, LACUNA_OK, text);
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
    return say(answer, LACUNA_OK, "[{}]");
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

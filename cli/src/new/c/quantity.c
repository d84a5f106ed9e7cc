/* `skeleton`: the crest factor of a curve, its largest magnitude divided by its root mean square.
 *
 * It is the square root of two for a sine and larger for impacts. It is undefined for a curve of zeros.
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- texts ---- */

static int32_t say(const LacunaAnswer *answer, int32_t status, const char *text)
{
    lacuna_say(answer, text, strlen(text));
    return status;
}

/* The place after a piece of a text; the length of the text if it does not have the piece. */
static size_t after(LacunaText text, const char *piece)
{
    const size_t length = strlen(piece);
    size_t at;
    for (at = 0; at + length <= text.length; ++at) {
        if (memcmp(text.bytes + at, piece, length) == 0) {
            return at + length;
        }
    }
    return text.length;
}

static int has(LacunaText text, const char *piece)
{
    return after(text, piece) < text.length;
}

/* ---- the options ---- */

typedef struct {
    int about_mean;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, LACUNA_OK,
        "{\"type\":\"object\",\"description\":\"Crest factor: the largest magnitude of a curve divided by its root mean "
        "square, or by that about its mean.\",\"additionalProperties\":false,\"properties\":{"
        "\"about_mean\":{\"type\":\"boolean\",\"default\":false,\"description\":\"`true` takes the mean of the values off "
        "first.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    const int given = has(options, "\"about_mean\":"), yes = has(options, "\"about_mean\":true");
    Plugin *plugin;
    if (given && !yes && !has(options, "\"about_mean\":false")) {
        return say(answer, LACUNA_REJECTED,
            "[{\"at\":\"about_mean\",\"message\":\"wrong value for `about_mean`\",\"expected\":\"true or false\"}]");
    }
    plugin = malloc(sizeof *plugin);
    if (plugin == NULL) {
        return say(answer, LACUNA_STOP, "there is no memory left");
    }
    plugin->about_mean = yes;
    *out = plugin;
    return LACUNA_OK;
}

/* All options with their defaults, which the record of a run keeps. */
static int32_t options(void *plugin, const LacunaAnswer *answer)
{
    const Plugin *p = plugin;
    return say(answer, LACUNA_OK, p->about_mean ? "{\"about_mean\":true}" : "{\"about_mean\":false}");
}

/* ---- the quantity ---- */

static int32_t unit(void *functional, const LacunaAnswer *answer)
{
    (void)functional;
    return say(answer, LACUNA_OK, "1");
}

static double crest_factor(const double *y, size_t count, int about_mean)
{
    double mean = 0.0, square = 0.0, peak = 0.0;
    size_t i;
    for (i = 0; i < count && about_mean; ++i) {
        mean += y[i] / (double)count;
    }
    for (i = 0; i < count; ++i) {
        square += (y[i] - mean) * (y[i] - mean) / (double)count;
        peak = fmax(peak, fabs(y[i] - mean));
    }
    return peak / sqrt(square);
}

static int32_t value(void *functional, LacunaNumbers arguments, double *values, const LacunaAnswer *answer)
{
    const Plugin *f = functional;
    size_t i;
    (void)answer;
    for (i = 0; i < arguments.rows; ++i) {
        values[i] = crest_factor(arguments.values + i * arguments.columns, arguments.columns, f->about_mean);
    }
    return LACUNA_OK;
}

static const LacunaFunctionalFunctions functional_functions = {
    .size = sizeof(LacunaFunctionalFunctions), .destroy = free, .unit = unit, .value = value
};

static int32_t of_curve(void *plugin, uint8_t *curve, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)answer;
    *curve = 1;
    return LACUNA_OK;
}

/* 1 if the curve has at least two points: a comma stands between the numbers of its grid. */
static int has_points(LacunaText arguments)
{
    size_t at = after(arguments, "\"grid\":[");
    while (at < arguments.length && arguments.bytes[at] != ']') {
        if (arguments.bytes[at++] == ',') {
            return 1;
        }
    }
    return 0;
}

static int32_t bind(void *plugin, LacunaText arguments, LacunaFunctional *out, const LacunaAnswer *answer)
{
    Plugin *copy;
    if (!has_points(arguments)) {
        return say(answer, LACUNA_REJECTED,
            "[{\"at\":\"use\",\"message\":\"a curve of one point has no crest factor\",\"help\":[\"widen the `window`\"]}]");
    }
    /* The functional may outlive the plugin, and keeps what it needs of it. */
    copy = malloc(sizeof *copy);
    if (copy == NULL) {
        return say(answer, LACUNA_STOP, "there is no memory left");
    }
    *copy = *(const Plugin *)plugin;
    out->size = sizeof *out;
    out->functional = copy;
    out->functions = &functional_functions;
    return LACUNA_OK;
}

/* ---- the library ---- */

static const LacunaComponentFunctions component = {
    .size = sizeof(LacunaComponentFunctions), .schema = schema, .create = create, .destroy = free, .options = options
};

static const LacunaQuantityFunctions quantity = {
    .size = sizeof(LacunaQuantityFunctions), .of_curve = of_curve, .bind = bind
};

static const LacunaEntry entries[] = {
    LACUNA_ENTRY("quantity", "skeleton", component, quantity)
};

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("quantity", "skeleton"), entries);

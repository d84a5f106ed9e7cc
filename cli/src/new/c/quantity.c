/* `skeleton`: the crest factor of a curve, its largest magnitude divided by its root mean square.
 *
 * It is the square root of two for a sine and larger for impacts. It is undefined for a curve of zeros.
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdlib.h>

/* ---- the options ---- */

typedef struct {
    int about_mean;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return lacuna_say_text(answer,
        "{\"type\":\"object\",\"description\":\"Crest factor: the largest magnitude of a curve divided by its root mean "
        "square, or by that about its mean.\",\"additionalProperties\":false,\"properties\":{"
        "\"about_mean\":{\"type\":\"boolean\",\"default\":false,\"description\":\"`true` takes the mean of the values off "
        "first.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    const int about_mean = lacuna_json_true(lacuna_json(options, "about_mean"), 0);
    Plugin *plugin;
    if (about_mean < 0) {
        return lacuna_wrong_option(answer, "about_mean", "true or false");
    }
    plugin = malloc(sizeof *plugin);
    if (plugin == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    plugin->about_mean = about_mean;
    *out = plugin;
    return LACUNA_OK;
}

/* All options with their defaults, which the record of a run keeps. */
static int32_t options(void *plugin, const LacunaAnswer *answer)
{
    const Plugin *p = plugin;
    return lacuna_say_text(answer, p->about_mean ? "{\"about_mean\":true}" : "{\"about_mean\":false}");
}

/* ---- the quantity ---- */

static int32_t unit(void *functional, const LacunaAnswer *answer)
{
    (void)functional;
    return lacuna_say_text(answer, "1");
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

static int32_t bind(void *plugin, LacunaText arguments, LacunaFunctional *out, const LacunaAnswer *answer)
{
    Plugin *copy;
    if (lacuna_json_count(lacuna_json(arguments, "curve/grid")) < 2) {
        return lacuna_fail(answer, LACUNA_REJECTED,
        "[{\"at\":\"use\",\"message\":\"a curve of one point has no crest factor\",\"help\":[\"widen the `window`\"]}]");
    }
    /* The functional may outlive the plugin, and keeps what it needs of it. */
    copy = malloc(sizeof *copy);
    if (copy == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
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

/* `skeleton`: exponential decay, `amplitude exp(-rate t) + background` at any times.
 *
 * The charge of a capacitor, the activity of one isotope, a first-order reaction. The response has one axis, a grid of
 * times in seconds; amplitude and rate are the inputs.
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdlib.h>

/* ---- the options ---- */

typedef struct {
    double background;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return lacuna_say_text(answer,
        "{\"type\":\"object\",\"description\":\"Exponential decay: `amplitude exp(-rate t) + background` at any times.\","
        "\"additionalProperties\":false,\"properties\":{"
        "\"background\":{\"type\":\"number\",\"default\":0.0,\"description\":\"Value after complete decay, in the unit of "
        "the response.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    const double background = lacuna_json_number(lacuna_json(options, "background"), 0.0);
    Plugin *plugin;
    if (!isfinite(background)) {
        return lacuna_wrong_option(answer, "background", "a finite number");
    }
    plugin = malloc(sizeof *plugin);
    if (plugin == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    plugin->background = background;
    *out = plugin;
    return LACUNA_OK;
}

/* All options with their defaults, which the record of a run keeps. */
static int32_t options(void *plugin, const LacunaAnswer *answer)
{
    lacuna_say_text(answer, "{\"background\":");
    lacuna_say_number(answer, ((const Plugin *)plugin)->background);
    return lacuna_say_text(answer, "}");
}

/* ---- the model ---- */

/* The inputs, with the amplitude in the unit of the response; the response is that of the study. */
static int32_t signature(void *plugin, LacunaText context, const LacunaAnswer *answer)
{
    (void)plugin;
    lacuna_say_text(answer,
        "{\"inputs\":[{\"name\":\"amplitude\",\"default\":1.0,\"low\":null,\"high\":null,"
        "\"description\":\"the response at time zero, less the background\",\"unit\":");
    lacuna_say_value(answer, lacuna_json(context, "layout/unit"));
    return lacuna_say_text(answer,
        "},{\"name\":\"rate\",\"unit\":\"1/s\",\"default\":1.0,\"low\":null,\"high\":null,"
        "\"description\":\"the share that decays in a unit of time\"}],\"resamples\":true}");
}

/* The times of the response, to be freed, and their number; or the reason why the response is none of this model. */
static const char *times(const LacunaCalls *calls, double **out, size_t *count)
{
    const LacunaText axes = lacuna_json(calls->about, "layout/axes"), grid = lacuna_json(axes, "0/coordinates/grid");
    if (lacuna_json_count(axes) != 1 || !lacuna_json_is(lacuna_json(axes, "0/name"), "time") ||
        !lacuna_json_is(lacuna_json(grid, "unit"), "s")) {
        return "expected a response with one axis, `time` in `s`";
    }
    *out = lacuna_json_numbers(lacuna_json(grid, "values"), count);
    return *out == NULL ? "there is no memory left" : NULL;
}

/* One run; returns 0 if a value is not finite. */
static int decay(double amplitude, double rate, double background, const double *t, size_t count, double *response)
{
    int finite = 1;
    size_t i;
    for (i = 0; i < count; ++i) {
        response[i] = amplitude * exp(-rate * t[i]) + background;
        finite = finite && isfinite(response[i]);
    }
    return finite;
}

/* All calls of a batch; the text is a list with `null` for each call that has an answer. */
static int32_t predict(void *plugin, const LacunaCalls *calls, double *responses, int32_t *statuses, uint8_t *valid,
                       const LacunaAnswer *answer)
{
    const double background = ((const Plugin *)plugin)->background;
    double *t = NULL;
    size_t i, count = 0;
    const char *wrong = times(calls, &t, &count);
    if (wrong == NULL && calls->inputs.columns != 2) {
        wrong = "expected two inputs, `amplitude` and `rate`";
    }
    for (i = 0; wrong == NULL && i < calls->inputs.rows; ++i) {
        const double *input = calls->inputs.values + 2 * i;
        const int finite = decay(input[0], input[1], background, t, count, responses + i * count);
        valid[i] = 1;
        statuses[i] = finite ? LACUNA_OK : LACUNA_REJECTED;
        lacuna_say_text(answer, i == 0 ? "[" : ",");
        lacuna_say_text(answer, finite ? "null" : "{\"message\":\"the response is not finite\"}");
    }
    free(t);
    if (wrong != NULL) {
        return lacuna_fail(answer, LACUNA_FATAL, wrong);
    }
    return lacuna_say_text(answer, calls->inputs.rows > 0 ? "]" : "");
}

/* The derivatives of each value (rows) by amplitude and rate (columns). Without a call the question is only whether
 * there are derivatives. */
static int32_t jacobian(void *plugin, const LacunaCalls *calls, double *slopes, const LacunaAnswer *answer)
{
    double *t = NULL;
    size_t i, count = 0;
    const char *wrong = calls->inputs.rows == 0 ? NULL : times(calls, &t, &count);
    (void)plugin;
    if (calls->inputs.rows == 0) {
        return LACUNA_OK;
    }
    if (wrong == NULL && calls->inputs.columns != 2) {
        wrong = "expected two inputs, `amplitude` and `rate`";
    }
    for (i = 0; wrong == NULL && i < count; ++i) {
        const double decayed = exp(-calls->inputs.values[1] * t[i]);
        slopes[2 * i] = decayed;
        slopes[2 * i + 1] = -t[i] * calls->inputs.values[0] * decayed;
    }
    free(t);
    return wrong == NULL ? LACUNA_OK : lacuna_fail(answer, LACUNA_FATAL, wrong);
}

/* Texts are read once a batch, not once a run. */
static size_t batch(void *plugin)
{
    (void)plugin;
    return 16;
}

/* ---- the library ---- */

static const LacunaComponentFunctions component = {
    .size = sizeof(LacunaComponentFunctions), .schema = schema, .create = create, .destroy = free, .options = options
};

static const LacunaModelFunctions model = {
    .size = sizeof(LacunaModelFunctions), .signature = signature, .predict = predict, .batch = batch,
    .jacobian = jacobian
};

static const LacunaEntry entries[] = {
    LACUNA_ENTRY("model", "skeleton", component, model)
};

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("model", "skeleton"), entries);

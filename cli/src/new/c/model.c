/* `skeleton`: exponential decay, `amplitude exp(-rate t) + background` at any times.
 *
 * The charge of a capacitor, the activity of one isotope, a first-order reaction. The response has one axis, a grid of
 * times in seconds; amplitude and rate are the inputs.
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

/* The text after a piece of JSON, which the program writes without blanks; NULL if it does not have the piece. */
static const char *after(const char *json, const char *piece)
{
    const char *at = json == NULL ? NULL : strstr(json, piece);
    return at == NULL ? NULL : at + strlen(piece);
}

/* ---- the options ---- */

typedef struct {
    double background;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, LACUNA_OK,
        "{\"type\":\"object\",\"description\":\"Exponential decay: `amplitude exp(-rate t) + background` at any times.\","
        "\"additionalProperties\":false,\"properties\":{"
        "\"background\":{\"type\":\"number\",\"default\":0.0,\"description\":\"Value after complete decay, in the unit of "
        "the response.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    char *text = copy_of(options), *end = NULL;
    const char *at = after(text, "\"background\":");
    Plugin *plugin = malloc(sizeof *plugin);
    if (text == NULL || plugin == NULL) {
        free(text);
        free(plugin);
        return say(answer, LACUNA_STOP, "there is no memory left");
    }
    plugin->background = at == NULL ? 0.0 : strtod(at, &end);
    free(text);
    if (at != NULL && (end == at || !isfinite(plugin->background))) {
        free(plugin);
        return say(answer, LACUNA_REJECTED,
            "[{\"at\":\"background\",\"message\":\"wrong value for `background`\",\"expected\":\"a finite number\"}]");
    }
    *out = plugin;
    return LACUNA_OK;
}

/* All options with their defaults, which the record of a run keeps. */
static int32_t options(void *plugin, const LacunaAnswer *answer)
{
    char text[64];
    snprintf(text, sizeof text, "{\"background\":%.17g}", ((const Plugin *)plugin)->background);
    return say(answer, LACUNA_OK, text);
}

/* ---- the model ---- */

/* The inputs, with the amplitude in the unit of the response; the response is that of the study. */
static int32_t signature(void *plugin, LacunaText context, const LacunaAnswer *answer)
{
    char *text = copy_of(context);
    const char *unit = after(after(text, "\"layout\":"), "\"unit\":\"");
    (void)plugin;
    say(answer, LACUNA_OK,
        "{\"inputs\":[{\"name\":\"amplitude\",\"default\":1.0,\"low\":null,\"high\":null,"
        "\"description\":\"the response at time zero, less the background\",\"unit\":\"");
    lacuna_say(answer, unit == NULL ? "1" : unit, unit == NULL ? 1 : strcspn(unit, "\""));
    free(text);
    return say(answer, LACUNA_OK,
        "\"},{\"name\":\"rate\",\"unit\":\"1/s\",\"default\":1.0,\"low\":null,\"high\":null,"
        "\"description\":\"the share that decays in a unit of time\"}],\"resamples\":true}");
}

/* The times of the response, to be freed, and their number; or the reason why the response is none of this model. */
static const char *times(const LacunaCalls *calls, double **out, size_t *count)
{
    static const char *const only = "expected a response with one axis, `time` in `s`";
    char *text = copy_of(calls->about), *end;
    const char *at = after(text, "\"axes\":[{\"name\":\"time\",\"coordinates\":{\"grid\":{\"values\":[");
    const size_t length = at == NULL ? 0 : strcspn(at, "]");
    size_t i;
    *count = 1;
    for (i = 0; i < length; ++i) {
        *count += at[i] == ',';
    }
    *out = malloc(*count * sizeof **out);
    if (text == NULL || *out == NULL) {
        free(text);
        return "there is no memory left";
    }
    if (length == 0 || strncmp(at + length, "],\"unit\":\"s\"}}}]", 16) != 0) {
        free(text);
        return only;
    }
    for (i = 0; i < *count; ++i) {
        (*out)[i] = strtod(at, &end);
        at = end + 1;
    }
    free(text);
    return NULL;
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
    size_t i, count;
    const char *wrong = times(calls, &t, &count);
    if (wrong == NULL && calls->inputs.columns != 2) {
        wrong = "expected two inputs, `amplitude` and `rate`";
    }
    for (i = 0; wrong == NULL && i < calls->inputs.rows; ++i) {
        const double *input = calls->inputs.values + 2 * i;
        const int finite = decay(input[0], input[1], background, t, count, responses + i * count);
        valid[i] = 1;
        statuses[i] = finite ? LACUNA_OK : LACUNA_REJECTED;
        say(answer, LACUNA_OK, i == 0 ? "[" : ",");
        say(answer, LACUNA_OK, finite ? "null" : "{\"message\":\"the response is not finite\"}");
    }
    free(t);
    if (wrong != NULL) {
        return say(answer, LACUNA_FATAL, wrong);
    }
    return say(answer, LACUNA_OK, calls->inputs.rows > 0 ? "]" : "");
}

/* The derivatives of each value (rows) by amplitude and rate (columns). Without a call the question is only whether
 * there are derivatives. */
static int32_t jacobian(void *plugin, const LacunaCalls *calls, double *slopes, const LacunaAnswer *answer)
{
    double *t = NULL;
    size_t i, count;
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
    return wrong == NULL ? LACUNA_OK : say(answer, LACUNA_FATAL, wrong);
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

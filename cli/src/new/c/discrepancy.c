/* `skeleton`: independent normal noise with one unknown standard deviation s.
 *
 * The errors that all replicates share add to the variance of the mean curve, once, whatever the number of replicates;
 * their correlation between outputs is left out here (`examples/plugin_c/plain_gaussian.c` of Lacuna's source keeps it).
 * With n_i measured values of output i, their mean y_i, the variance h_i of the shared errors and the response m,
 *
 *     -2 log L = sum_i [ (n_i - 1) log s^2 + log n_i + log v_i + (y_i - m_i)^2 / v_i ] + S / s^2 + n log(2 pi)
 *
 * where v_i = s^2 / n_i + h_i, S is the scatter of the replicates about their means and n the number of values.
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TWO_PI 6.283185307179586

/* ---- the options ---- */

/* The scale of the prior; 0 if it follows from the data. */
typedef struct {
    double scale;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return lacuna_say_text(answer,
        "{\"type\":\"object\",\"description\":\"Independent normal noise with one standard deviation for all outputs. The "
        "errors that all replicates share are added without their correlation between outputs.\","
        "\"additionalProperties\":false,\"properties\":{"
        "\"scale\":{\"type\":\"number\",\"exclusiveMinimum\":0,\"description\":\"Scale of the half-normal prior of the "
        "standard deviation, in the unit of the response. Default: the root mean square of all measured values.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    const LacunaText given = lacuna_json(options, "scale");
    const double scale = lacuna_json_number(given, 0.0);
    Plugin *plugin;
    if (given.length > 0 && (!(scale > 0.0) || isinf(scale))) {
        return lacuna_wrong_option(answer, "scale", "a number above 0");
    }
    plugin = malloc(sizeof *plugin);
    if (plugin == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    plugin->scale = scale;
    *out = plugin;
    return LACUNA_OK;
}

/* ---- the likelihood ---- */

/* What it needs of one output: number and mean of the measured values, and the variance of the errors that all
 * replicates share, with and without those that a new replicate does not have. */
typedef struct {
    double number, mean, shared, predictive;
} Output;

typedef struct {
    size_t outputs, replicates;
    double scatter, scale;
    Output *each;
    char unit[64];
} Likelihood;

static void end_likelihood(void *object)
{
    Likelihood *l = object;
    if (l != NULL) {
        free(l->each);
        free(l);
    }
}

static int32_t hyperparameters(void *object, const LacunaAnswer *answer)
{
    const Likelihood *l = object;
    lacuna_say_text(answer, "[{\"name\":\"deviation\",\"symbol\":\"s\",\"unit\":");
    lacuna_say_string(answer, l->unit);
    lacuna_say_text(answer, ",\"prior\":{\"half_normal\":");
    lacuna_say_number(answer, l->scale);
    /* It starts at the median of its prior. */
    lacuna_say_text(answer, "},\"log\":true,\"start\":");
    lacuna_say_number(answer, 0.6744897501960817 * l->scale);
    return lacuna_say_text(answer, "}]");
}

/* The log-likelihood at one response and, where they are asked for, its derivatives; minus infinity for what is no
 * standard deviation. */
static double judge(const Likelihood *l, const double *response, double s, double *by_response, double *by_s)
{
    const double variance = s * s;
    double twice, slope;
    size_t i;
    if (!(s > 0.0 && variance > 0.0) || isinf(variance)) {
        return -INFINITY;
    }
    twice = slope = l->scatter / variance;
    for (i = 0; i < l->outputs; ++i) {
        const Output *o = l->each + i;
        double v, gap;
        if (o->number == 0.0) {
            continue;
        }
        v = variance / o->number + o->shared;
        gap = o->mean - response[i];
        twice += (o->number - 1.0) * log(variance) + log(o->number) + log(v) + gap * gap / v;
        twice += o->number * log(TWO_PI);
        slope += (gap * gap / v - 1.0) * variance / o->number / v - (o->number - 1.0);
        if (by_response != NULL) {
            by_response[i] = gap / v;
        }
    }
    if (by_s != NULL) {
        *by_s = slope / s;
    }
    return isnan(twice) ? -INFINITY : -0.5 * twice;
}

static int32_t log_likelihood(void *object, LacunaNumbers responses, LacunaNumbers hyper, double *values,
                              const LacunaAnswer *answer)
{
    size_t i;
    (void)answer;
    for (i = 0; i < responses.rows; ++i) {
        values[i] = judge(object, responses.values + i * responses.columns, hyper.values[i], NULL, NULL);
    }
    return LACUNA_OK;
}

static int32_t gradient(void *object, LacunaNumbers responses, LacunaNumbers hyper, double *by_response,
                        double *by_hyper, const LacunaAnswer *answer)
{
    size_t i;
    (void)answer;
    /* All that is asked for is written, also where nothing was measured. */
    memset(by_response, 0, responses.rows * responses.columns * sizeof *by_response);
    memset(by_hyper, 0, responses.rows * sizeof *by_hyper);
    for (i = 0; i < responses.rows; ++i) {
        judge(object, responses.values + i * responses.columns, hyper.values[i], by_response + i * responses.columns,
              by_hyper + i);
    }
    return LACUNA_OK;
}

static int32_t predictive(void *object, LacunaNumbers response, LacunaNumbers hyper, const LacunaAnswer *answer)
{
    const Likelihood *l = object;
    double *parts = malloc(2 * l->outputs * sizeof *parts);
    size_t i;
    (void)response;
    if (parts == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    for (i = 0; i < l->outputs; ++i) {
        parts[i] = hyper.values[0] * hyper.values[0];
        parts[l->outputs + i] = l->each[i].predictive;
    }
    lacuna_give(answer, parts, 2, l->outputs);
    free(parts);
    return lacuna_say_text(answer, "[\"discrepancy\",\"common\"]");
}

static int32_t simulate(void *object, LacunaNumbers response, LacunaNumbers hyper, LacunaKey key, double *values,
                        const LacunaAnswer *answer)
{
    const Likelihood *l = object;
    /* All that is drawn follows from the key of the call, never from `rand` or a clock. */
    LacunaRandom random = lacuna_random(key);
    size_t i, r;
    (void)answer;
    for (i = 0; i < l->outputs; ++i) {
        const double centre = response.values[i] + sqrt(l->each[i].shared) * lacuna_normal(&random);
        for (r = 0; r < l->replicates; ++r) {
            values[r * l->outputs + i] = centre + hyper.values[0] * lacuna_normal(&random);
        }
    }
    return LACUNA_OK;
}

/* A few operations for each output: the program may ask often. */
static int32_t is_cheap(void *object, uint8_t *cheap, const LacunaAnswer *answer)
{
    (void)object;
    (void)answer;
    *cheap = 1;
    return LACUNA_OK;
}

static const LacunaLikelihoodFunctions likelihood_functions = {
    .size = sizeof(LacunaLikelihoodFunctions), .destroy = end_likelihood, .hyperparameters = hyperparameters,
    .log_likelihood = log_likelihood, .gradient = gradient, .predictive = predictive, .simulate = simulate,
    .is_cheap = is_cheap
};

/* ---- the data ---- */

/* Counts, means and scatter of the measured values, and the scale of the prior; or what is wrong with the values. */
static const char *summarise(Likelihood *l, const LacunaKnown *known)
{
    double squares = 0.0, count = 0.0;
    size_t i, r;
    for (i = 0; i < l->outputs; ++i) {
        Output *o = l->each + i;
        for (r = 0; r < l->replicates; ++r) {
            const double y = known->values.values[r * l->outputs + i];
            if (known->measured[r * l->outputs + i]) {
                /* Welford's recurrence, which loses no digits to a large mean. */
                const double before = y - o->mean;
                o->number += 1.0;
                o->mean += before / o->number;
                l->scatter += before * (y - o->mean);
                squares += y * y;
            }
        }
        count += o->number;
    }
    if (count == 0.0) {
        return "the measurements hold no value";
    }
    if (!isfinite(squares)) {
        return "a measured value is not finite";
    }
    if (l->scale == 0.0) {
        l->scale = squares > 0.0 ? sqrt(squares / count) : 1.0;
    }
    return NULL;
}

/* Adds up the variances of the errors that all replicates share; or says what is wrong with one. */
static const char *add_shared(Likelihood *l, const LacunaKnown *known)
{
    size_t c, i, k;
    for (c = 0; c < known->common_count; ++c) {
        const LacunaNumbers f = known->common[c].factor;
        if (f.rows != l->outputs) {
            return "an error that all replicates share is of another shape than the response";
        }
        for (i = 0; i < f.rows; ++i) {
            for (k = 0; k < f.columns; ++k) {
                const double part = f.values[i * f.columns + k] * f.values[i * f.columns + k];
                l->each[i].shared += part;
                l->each[i].predictive += known->common[c].predictive ? part : 0.0;
            }
        }
    }
    return NULL;
}

static int32_t likelihood(void *plugin, const LacunaKnown *known, LacunaLikelihood *out, const LacunaAnswer *answer)
{
    Likelihood *l = calloc(1, sizeof *l);
    const char *wrong;
    LacunaText unit;
    if (l == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    l->outputs = known->values.columns;
    l->replicates = known->values.rows;
    l->scale = ((const Plugin *)plugin)->scale;
    l->each = calloc(l->outputs + 1, sizeof *l->each);
    wrong = l->each == NULL ? "there is no memory left" : summarise(l, known);
    wrong = wrong == NULL ? add_shared(l, known) : wrong;
    unit = lacuna_json(known->about, "layout/unit");
    if (wrong == NULL && lacuna_json_string(unit, l->unit, sizeof l->unit) >= sizeof l->unit) {
        wrong = "the response has no unit of fewer than 64 bytes";
    }
    if (wrong != NULL) {
        end_likelihood(l);
        return lacuna_fail(answer, LACUNA_STOP, wrong);
    }
    out->size = sizeof *out;
    out->likelihood = l;
    out->functions = &likelihood_functions;
    return LACUNA_OK;
}

/* ---- the library ---- */

static const LacunaComponentFunctions component = {
    .size = sizeof(LacunaComponentFunctions), .schema = schema, .create = create, .destroy = free
};

static const LacunaDiscrepancyFunctions discrepancy = {
    .size = sizeof(LacunaDiscrepancyFunctions), .likelihood = likelihood
};

static const LacunaEntry entries[] = {
    LACUNA_ENTRY("discrepancy", "skeleton", component, discrepancy)
};

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("discrepancy", "skeleton"), entries);

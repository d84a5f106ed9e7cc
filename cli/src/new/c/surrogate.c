/* `skeleton`: Gaussian functions around the runs, with weights by ridge regression.
 *
 * With u the parameters scaled to -1..1 over the runs and y_0 the mean response,
 *
 *     y(u) = y_0 + sum_r k(|u - u_r|) w_r,    k(d) = exp(-d^2 / (2 length^2)),    (K + ridge I) w = y - y_0
 *
 * and the leave-one-out residual of run r is w_r / ((K + ridge I)^-1)_rr (Rippa, Adv. Comput. Math. 11 (1999) 193).
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RIDGE 1e-6

/* ---- the options ---- */

typedef struct {
    double length;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return lacuna_say_text(answer,
        "{\"type\":\"object\",\"description\":\"Gaussian functions around the runs, for smooth responses of few parameters.\","
        "\"additionalProperties\":false,\"properties\":{"
        "\"length\":{\"type\":\"number\",\"exclusiveMinimum\":0,\"default\":1.0,\"description\":\"Standard deviation of the "
        "Gaussian functions, in half ranges of the parameters.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    const double length = lacuna_json_number(lacuna_json(options, "length"), 1.0);
    Plugin *plugin;
    if (!(length > 0.0) || isinf(length)) {
        return lacuna_wrong_option(answer, "length", "a number above 0");
    }
    plugin = malloc(sizeof *plugin);
    if (plugin == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    plugin->length = length;
    *out = plugin;
    return LACUNA_OK;
}

/* ---- the emulator ---- */

/* All numbers lie in one block, which is what `save` writes. */
typedef struct {
    size_t dimension, outputs, runs, count;
    double *numbers;        /* `dimension`, `outputs`, `runs` and the length, and then: */
    double *centre, *half;  /* of the range of each parameter */
    double *points;         /* the scaled parameters, runs x dimension */
    double *mean;           /* of each output */
    double *weights;        /* runs x outputs */
    double *relative;       /* the error of each output */
    double *residuals;      /* runs x outputs */
} Emulator;

static void end_emulator(void *object)
{
    Emulator *e = object;
    if (e != NULL) {
        free(e->numbers);
        free(e);
    }
}

/* The number of all numbers, as a float because it may be large. */
static double size_of(double dimension, double outputs, double runs)
{
    return 4.0 + (2.0 + runs) * dimension + 2.0 * (1.0 + runs) * outputs;
}

/* An emulator whose numbers are zero; NULL if no memory holds it. */
static Emulator *begin_emulator(double dimension, double outputs, double runs)
{
    const double count = size_of(dimension, outputs, runs);
    Emulator *e = count < 1e12 ? calloc(1, sizeof *e) : NULL;
    double *numbers = e == NULL ? NULL : calloc((size_t)count, sizeof *numbers);
    if (numbers == NULL) {
        free(e);
        return NULL;
    }
    numbers[0] = dimension;
    numbers[1] = outputs;
    numbers[2] = runs;
    e->dimension = (size_t)dimension;
    e->outputs = (size_t)outputs;
    e->runs = (size_t)runs;
    e->count = (size_t)count;
    e->numbers = numbers;
    e->centre = numbers + 4;
    e->half = e->centre + e->dimension;
    e->points = e->half + e->dimension;
    e->mean = e->points + e->runs * e->dimension;
    e->weights = e->mean + e->outputs;
    e->relative = e->weights + e->runs * e->outputs;
    e->residuals = e->relative + e->outputs;
    return e;
}

/* The difference of a point from a run in one parameter, in lengths. */
static double apart(const Emulator *e, const double *point, size_t run, size_t j)
{
    return ((point[j] - e->centre[j]) / e->half[j] - e->points[run * e->dimension + j]) / e->numbers[3];
}

static double kernel(const Emulator *e, const double *point, size_t run)
{
    double square = 0.0;
    size_t j;
    for (j = 0; j < e->dimension; ++j) {
        const double d = apart(e, point, run, j);
        square += d * d;
    }
    return exp(-0.5 * square);
}

static int32_t mean(void *object, LacunaNumbers points, double *values, const LacunaAnswer *answer)
{
    const Emulator *e = object;
    size_t i, r, o;
    (void)answer;
    for (i = 0; i < points.rows; ++i, values += e->outputs) {
        memcpy(values, e->mean, e->outputs * sizeof *values);
        for (r = 0; r < e->runs; ++r) {
            const double k = kernel(e, points.values + i * e->dimension, r);
            for (o = 0; o < e->outputs; ++o) {
                values[o] += k * e->weights[r * e->outputs + o];
            }
        }
    }
    return LACUNA_OK;
}

static int32_t jacobian(void *object, LacunaNumbers point, double *out, const LacunaAnswer *answer)
{
    const Emulator *e = object;
    size_t r, o, j;
    (void)answer;
    memset(out, 0, e->outputs * e->dimension * sizeof *out);
    for (r = 0; r < e->runs; ++r) {
        const double k = kernel(e, point.values, r);
        for (j = 0; j < e->dimension; ++j) {
            const double slope = -k * apart(e, point.values, r, j) / (e->half[j] * e->numbers[3]);
            for (o = 0; o < e->outputs; ++o) {
                out[o * e->dimension + j] += slope * e->weights[r * e->outputs + o];
            }
        }
    }
    return LACUNA_OK;
}

static int32_t fit_error(void *object, const LacunaAnswer *answer)
{
    const Emulator *e = object;
    lacuna_give(answer, e->relative, 1, e->outputs);
    lacuna_give(answer, e->residuals, e->runs, e->outputs);
    return LACUNA_OK;
}

static int32_t save(void *object, const LacunaAnswer *answer)
{
    const Emulator *e = object;
    lacuna_say(answer, (const char *)e->numbers, e->count * sizeof *e->numbers);
    return LACUNA_OK;
}

static const LacunaEmulatorFunctions emulator_functions = {
    .size = sizeof(LacunaEmulatorFunctions), .destroy = end_emulator, .mean = mean, .jacobian = jacobian,
    .fit_error = fit_error, .save = save
};

static int32_t hand_over(Emulator *e, LacunaEmulator *out)
{
    out->size = sizeof *out;
    out->emulator = e;
    out->functions = &emulator_functions;
    out->dimension = e->dimension;
    out->outputs = e->outputs;
    return LACUNA_OK;
}

static int is_count(double x)
{
    return x >= 0.0 && x <= 1e9 && floor(x) == x;
}

static int32_t load(void *plugin, LacunaText bytes, LacunaEmulator *out, const LacunaAnswer *answer)
{
    double counts[3] = {-1.0, -1.0, -1.0};
    Emulator *e;
    (void)plugin;
    if (bytes.length >= sizeof counts) {
        memcpy(counts, bytes.bytes, sizeof counts);
    }
    if (!is_count(counts[0]) || !is_count(counts[1]) || !is_count(counts[2]) ||
        size_of(counts[0], counts[1], counts[2]) * sizeof *counts != (double)bytes.length) {
        return lacuna_fail(answer, LACUNA_STOP, "these bytes are no emulator");
    }
    e = begin_emulator(counts[0], counts[1], counts[2]);
    if (e == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    memcpy(e->numbers, bytes.bytes, bytes.length);
    return hand_over(e, out);
}

/* ---- the fit ---- */

/* The inverse of a positive definite matrix in place, by Gauss and Jordan; returns 0 if it has none. */
static int invert(double *a, size_t n)
{
    size_t i, j, k;
    for (k = 0; k < n; ++k) {
        const double pivot = a[k * n + k];
        if (!(pivot > 0.0)) {
            return 0;
        }
        a[k * n + k] = 1.0;
        for (j = 0; j < n; ++j) {
            a[k * n + j] /= pivot;
        }
        for (i = 0; i < n; ++i) {
            const double times = a[i * n + k];
            if (i != k) {
                a[i * n + k] = 0.0;
                for (j = 0; j < n; ++j) {
                    a[i * n + j] -= times * a[k * n + j];
                }
            }
        }
    }
    return 1;
}

/* Scales the parameters; returns 0 if all runs have the same value of one. */
static int scale(Emulator *e, const double *points)
{
    size_t i, j;
    for (j = 0; j < e->dimension; ++j) {
        double low = points[j], high = points[j];
        for (i = 1; i < e->runs; ++i) {
            low = fmin(low, points[i * e->dimension + j]);
            high = fmax(high, points[i * e->dimension + j]);
        }
        e->centre[j] = 0.5 * (low + high);
        e->half[j] = 0.5 * (high - low);
        for (i = 0; i < e->runs && e->half[j] > 0.0; ++i) {
            e->points[i * e->dimension + j] = (points[i * e->dimension + j] - e->centre[j]) / e->half[j];
        }
        if (!(e->half[j] > 0.0)) {
            return 0;
        }
    }
    return 1;
}

/* Mean, weights and errors of one output; `inverse` is that of the kernel matrix. */
static void fit_output(Emulator *e, const double *responses, const double *inverse, size_t o)
{
    double mean = 0.0, spread = 0.0, squares = 0.0;
    size_t i, k;
    for (i = 0; i < e->runs; ++i) {
        /* About the first run, so that a constant has exactly itself as its mean. */
        mean += (responses[i * e->outputs + o] - responses[o]) / (double)e->runs;
    }
    mean += responses[o];
    for (i = 0; i < e->runs; ++i) {
        const double off = responses[i * e->outputs + o] - mean;
        double weight = 0.0, left;
        for (k = 0; k < e->runs; ++k) {
            weight += inverse[i * e->runs + k] * (responses[k * e->outputs + o] - mean);
        }
        left = weight / inverse[i * e->runs + i];
        e->weights[i * e->outputs + o] = weight;
        e->residuals[i * e->outputs + o] = left;
        spread += off * off;
        squares += left * left;
    }
    e->mean[o] = mean;
    e->relative[o] = spread > 0.0 ? squares / spread : 0.0;
}

static int all_finite(LacunaNumbers numbers)
{
    size_t i;
    for (i = 0; i < numbers.rows * numbers.columns; ++i) {
        if (!isfinite(numbers.values[i])) {
            return 0;
        }
    }
    return 1;
}

/* Fits all outputs; returns the reason if that is not possible. */
static const char *fit_to(Emulator *e, const LacunaTraining *training)
{
    double *matrix = malloc(e->runs * e->runs * sizeof *matrix);
    const char *reason = NULL;
    size_t i, k, o;
    if (matrix == NULL) {
        reason = "there is no memory left";
    } else if (!scale(e, training->points.values)) {
        reason = "all runs have the same value of a parameter";
    }
    for (i = 0; reason == NULL && i < e->runs; ++i) {
        for (k = 0; k < e->runs; ++k) {
            matrix[i * e->runs + k] =
                kernel(e, training->points.values + i * e->dimension, k) + (i == k ? RIDGE : 0.0);
        }
    }
    if (reason == NULL && !invert(matrix, e->runs)) {
        reason = "the kernel matrix is not positive definite: choose a smaller `length`";
    }
    for (o = 0; reason == NULL && o < e->outputs; ++o) {
        fit_output(e, training->responses.values, matrix, o);
    }
    free(matrix);
    return reason;
}

static int32_t fit(void *plugin, const LacunaTraining *training, LacunaKey key, const LacunaProgress *progress,
                   LacunaEmulator *out, const LacunaAnswer *answer)
{
    const LacunaNumbers points = training->points, responses = training->responses;
    const char *reason;
    Emulator *e;
    (void)key;
    if (points.rows < 2 || points.rows != responses.rows) {
        return lacuna_fail(answer, LACUNA_STOP, "expected at least two runs, each with a response");
    }
    if (!all_finite(points) || !all_finite(responses)) {
        return lacuna_fail(answer, LACUNA_STOP, "a run has a value that is not finite");
    }
    e = begin_emulator((double)points.columns, (double)responses.columns, (double)points.rows);
    if (e == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    e->numbers[3] = ((const Plugin *)plugin)->length;
    reason = fit_to(e, training);
    if (reason != NULL) {
        end_emulator(e);
        return lacuna_fail(answer, LACUNA_STOP, reason);
    }
    progress->functions->add(progress->progress, responses.columns);
    return hand_over(e, out);
}

/* ---- the library ---- */

static const LacunaComponentFunctions component = {
    .size = sizeof(LacunaComponentFunctions), .schema = schema, .create = create, .destroy = free
};

static const LacunaSurrogateFunctions surrogate = {
    .size = sizeof(LacunaSurrogateFunctions), .fit = fit, .load = load
};

static const LacunaEntry entries[] = {
    LACUNA_ENTRY("surrogate", "skeleton", component, surrogate)
};

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("surrogate", "skeleton"), entries);

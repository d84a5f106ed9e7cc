/* A discrepancy in C: independent normal noise with one unknown variance, with the errors common to all
 * replicates.
 *
 * With n_i measured values of output i, their mean y_i and the response m, the variance v, and the common errors
 * F z (z standard normal), let e_i = y_i - m_i, A = I + F' N F / v and w = A^-1 F' N e / v (Woodbury). Then
 *
 *     log L = -1/2 [ n log(2 pi v) + log det A + (S + sum_i n_i (e_i - (F w)_i)^2) / v + |w|^2 ]
 *
 * where S is the scatter of the replicates about their means.
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TWO_PI 6.283185307179586

/* ---- the plugin ---- */

typedef struct {
    double scale;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return lacuna_say_text(answer,
        "{\"type\":\"object\",\"description\":\"Independent normal differences of one unknown variance. "
        "The example of a plugin in C.\",\"additionalProperties\":false,\"required\":[\"scale\"],\"properties\":{"
        "\"scale\":{\"type\":\"number\",\"exclusiveMinimum\":0,\"description\":\"The scale of the half-normal prior "
        "of the variance, in the squared unit of the response.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    const double scale = lacuna_json_number(lacuna_json(options, "scale"), NAN);
    Plugin *plugin;
    if (!(scale > 0.0) || isinf(scale)) {
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

typedef struct {
    size_t outputs, replicates, rank;
    double scale, count, scatter;
    double *number, *mean;  /* of the measured values of each output */
    double *factor;         /* outputs x rank */
    double *predictive;     /* the variance of the common errors that a new replicate has, one per output */
    size_t *added;          /* 1 for the columns of the factor that a new replicate has */
    char unit[64];
} Likelihood;

static void end_likelihood(void *object)
{
    Likelihood *l = object;
    if (l != NULL) {
        free(l->number);
        free(l->mean);
        free(l->factor);
        free(l->predictive);
        free(l->added);
        free(l);
    }
}

/* The lower Cholesky factor of a positive definite matrix, in place. */
static void cholesky(double *a, size_t n)
{
    size_t i, j, k;
    for (j = 0; j < n; ++j) {
        for (k = 0; k < j; ++k) {
            for (i = j; i < n; ++i) {
                a[i * n + j] -= a[i * n + k] * a[j * n + k];
            }
        }
        a[j * n + j] = sqrt(a[j * n + j]);
        for (i = j + 1; i < n; ++i) {
            a[i * n + j] /= a[j * n + j];
        }
    }
}

/* Solves L L' x = b in place of b. */
static void solve(const double *l, size_t n, double *b)
{
    size_t i, k;
    for (i = 0; i < n; ++i) {
        for (k = 0; k < i; ++k) {
            b[i] -= l[i * n + k] * b[k];
        }
        b[i] /= l[i * n + i];
    }
    for (i = n; i-- > 0;) {
        for (k = i + 1; k < n; ++k) {
            b[i] -= l[k * n + i] * b[k];
        }
        b[i] /= l[i * n + i];
    }
}

/* Quantities for the value and its derivatives at one response and variance. */
typedef struct {
    double *a;      /* the factor of A */
    double *w;
    double *error;  /* e - F w */
} Solved;

static void end_solved(Solved *s)
{
    free(s->a);
    free(s->w);
    free(s->error);
}

static int begin_solved(const Likelihood *l, const double *response, double v, Solved *s)
{
    const size_t r = l->rank;
    size_t i, j, k;
    s->a = calloc(r * r + 1, sizeof *s->a);
    s->w = calloc(r + 1, sizeof *s->w);
    s->error = calloc(l->outputs + 1, sizeof *s->error);
    if (s->a == NULL || s->w == NULL || s->error == NULL) {
        end_solved(s);
        return 0;
    }
    for (i = 0; i < l->outputs; ++i) {
        const double *f = l->factor + i * r;
        const double weight = l->number[i] / v;
        s->error[i] = l->number[i] > 0.0 ? l->mean[i] - response[i] : 0.0;
        for (j = 0; j < r; ++j) {
            s->w[j] += weight * f[j] * s->error[i];
            for (k = 0; k <= j; ++k) {
                s->a[j * r + k] += weight * f[j] * f[k];
            }
        }
    }
    for (j = 0; j < r; ++j) {
        s->a[j * r + j] += 1.0;
        for (k = 0; k < j; ++k) {
            s->a[k * r + j] = s->a[j * r + k];
        }
    }
    cholesky(s->a, r);
    solve(s->a, r, s->w);
    for (i = 0; i < l->outputs; ++i) {
        for (j = 0; j < r; ++j) {
            s->error[i] -= l->factor[i * r + j] * s->w[j];
        }
    }
    return 1;
}

static double square_sum(const Likelihood *l, const Solved *s)
{
    double sum = l->scatter;
    size_t i;
    for (i = 0; i < l->outputs; ++i) {
        sum += l->number[i] * s->error[i] * s->error[i];
    }
    return sum;
}

static int32_t hyperparameters(void *object, const LacunaAnswer *answer)
{
    const Likelihood *l = object;
    lacuna_say_text(answer, "[{\"name\":\"variance\",\"symbol\":\"v\",\"unit\":");
    lacuna_say_string(answer, l->unit);
    lacuna_say_text(answer, ",\"prior\":{\"half_normal\":");
    lacuna_say_number(answer, l->scale);
    lacuna_say_text(answer, "},\"log\":true,\"start\":");
    lacuna_say_number(answer, l->scale);
    return lacuna_say_text(answer, "}]");
}

static int32_t log_likelihood(void *object, LacunaNumbers responses, LacunaNumbers hyper, double *values,
                              const LacunaAnswer *answer)
{
    const Likelihood *l = object;
    size_t point, j;
    for (point = 0; point < responses.rows; ++point) {
        const double v = hyper.values[point];
        Solved s;
        double twice;
        values[point] = -INFINITY;
        if (!(v > 0.0) || isinf(v)) {
            continue;
        }
        if (!begin_solved(l, responses.values + point * responses.columns, v, &s)) {
            return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
        }
        twice = l->count * log(TWO_PI * v) + square_sum(l, &s) / v;
        for (j = 0; j < l->rank; ++j) {
            twice += s.w[j] * s.w[j] + 2.0 * log(s.a[j * l->rank + j]);
        }
        end_solved(&s);
        values[point] = isnan(twice) ? -INFINITY : -0.5 * twice;
    }
    return LACUNA_OK;
}

static int32_t gradient(void *object, LacunaNumbers responses, LacunaNumbers hyper, double *by_response,
                        double *by_hyper, const LacunaAnswer *answer)
{
    const Likelihood *l = object;
    size_t point, i, j;
    for (point = 0; point < responses.rows; ++point) {
        const double v = hyper.values[point];
        double *slopes = by_response + point * responses.columns;
        double trace = 0.0;
        Solved s;
        memset(slopes, 0, responses.columns * sizeof *slopes);
        by_hyper[point] = 0.0;
        if (!(v > 0.0) || isinf(v)) {
            continue;
        }
        if (!begin_solved(l, responses.values + point * responses.columns, v, &s)) {
            return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
        }
        for (i = 0; i < l->outputs; ++i) {
            slopes[i] = l->number[i] * s.error[i] / v;
        }
        /* The trace of A^-1, column by column. */
        for (j = 0; j < l->rank; ++j) {
            double *unit = calloc(l->rank, sizeof *unit);
            if (unit == NULL) {
                end_solved(&s);
                return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
            }
            unit[j] = 1.0;
            solve(s.a, l->rank, unit);
            trace += unit[j];
            free(unit);
        }
        by_hyper[point] = 0.5 * (square_sum(l, &s) / v - (l->count - (double)l->rank + trace)) / v;
        end_solved(&s);
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
        parts[i] = hyper.values[0];
        parts[l->outputs + i] = l->predictive[i];
    }
    lacuna_give(answer, parts, 2, l->outputs);
    free(parts);
    return lacuna_say_text(answer, "[\"discrepancy\",\"common\"]");
}

static int32_t simulate(void *object, LacunaNumbers response, LacunaNumbers hyper, LacunaKey key, double *values,
                        const LacunaAnswer *answer)
{
    const Likelihood *l = object;
    LacunaRandom random = lacuna_random(key);
    double *curve = malloc((l->outputs + 1) * sizeof *curve);
    size_t i, j, k;
    if (curve == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    memcpy(curve, response.values, l->outputs * sizeof *curve);
    for (j = 0; j < l->rank; ++j) {
        const double z = lacuna_normal(&random);
        for (i = 0; i < l->outputs && l->added[j]; ++i) {
            curve[i] += l->factor[i * l->rank + j] * z;
        }
    }
    for (k = 0; k < l->replicates; ++k) {
        for (i = 0; i < l->outputs; ++i) {
            values[k * l->outputs + i] = curve[i] + sqrt(hyper.values[0]) * lacuna_normal(&random);
        }
    }
    free(curve);
    return LACUNA_OK;
}

/* A few operations for each output and direction: the program may ask often. */
static int32_t is_cheap(void *object, uint8_t *cheap, const LacunaAnswer *answer)
{
    (void)object;
    (void)answer;
    *cheap = 1;
    return LACUNA_OK;
}

static const LacunaLikelihoodFunctions likelihood_functions = {
    sizeof(LacunaLikelihoodFunctions), end_likelihood, hyperparameters, log_likelihood, gradient, predictive, simulate,
    NULL, NULL, NULL, NULL, is_cheap
};

/* Counts, means and scatter of the measured values; returns 0 if one is not a number. */
static int summarise(Likelihood *l, const LacunaKnown *known)
{
    size_t i, k;
    for (i = 0; i < l->outputs; ++i) {
        double sum = 0.0;
        for (k = 0; k < l->replicates; ++k) {
            const size_t at = k * l->outputs + i;
            if (known->measured[at]) {
                if (!isfinite(known->values.values[at])) {
                    return 0;
                }
                l->number[i] += 1.0;
                sum += known->values.values[at];
            }
        }
        l->mean[i] = l->number[i] > 0.0 ? sum / l->number[i] : 0.0;
        l->count += l->number[i];
        for (k = 0; k < l->replicates; ++k) {
            const size_t at = k * l->outputs + i;
            if (known->measured[at]) {
                const double off = known->values.values[at] - l->mean[i];
                l->scatter += off * off;
            }
        }
    }
    return 1;
}

/* Puts the common errors side by side; returns 0 if one has another shape. */
static int gather(Likelihood *l, const LacunaKnown *known)
{
    size_t c, i, j, at = 0;
    for (c = 0; c < known->common_count; ++c) {
        const LacunaNumbers f = known->common[c].factor;
        if (f.rows != l->outputs) {
            return 0;
        }
        for (j = 0; j < f.columns; ++j, ++at) {
            l->added[at] = known->common[c].predictive;
            for (i = 0; i < f.rows; ++i) {
                const double entry = f.values[i * f.columns + j];
                l->factor[i * l->rank + at] = entry;
                l->predictive[i] += l->added[at] ? entry * entry : 0.0;
            }
        }
    }
    return 1;
}

/* The squared unit of the response; returns 0 if there is no room for it. */
static int read_unit(Likelihood *l, LacunaText about)
{
    char unit[sizeof l->unit - sizeof "()^2"];
    if (lacuna_json_string(lacuna_json(about, "layout/unit"), unit, sizeof unit) >= sizeof unit) {
        return 0;
    }
    strcpy(l->unit, strcmp(unit, "1") == 0 ? "1" : "(");
    if (l->unit[0] == '(') {
        strcat(strcat(l->unit, unit), ")^2");
    }
    return 1;
}

static int32_t likelihood(void *plugin, const LacunaKnown *known, LacunaLikelihood *out, const LacunaAnswer *answer)
{
    Likelihood *l = calloc(1, sizeof *l);
    size_t c;
    if (l == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    l->outputs = known->values.columns;
    l->replicates = known->values.rows;
    for (c = 0; c < known->common_count; ++c) {
        l->rank += known->common[c].factor.columns;
    }
    l->scale = ((const Plugin *)plugin)->scale;
    l->number = calloc(l->outputs + 1, sizeof *l->number);
    l->mean = calloc(l->outputs + 1, sizeof *l->mean);
    l->predictive = calloc(l->outputs + 1, sizeof *l->predictive);
    l->factor = calloc(l->outputs * l->rank + 1, sizeof *l->factor);
    l->added = calloc(l->rank + 1, sizeof *l->added);
    if (!l->number || !l->mean || !l->predictive || !l->factor || !l->added) {
        end_likelihood(l);
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    if (!summarise(l, known)) {
        end_likelihood(l);
        return lacuna_fail(answer, LACUNA_STOP, "a measured value is not finite");
    }
    if (l->count == 0.0) {
        end_likelihood(l);
        return lacuna_fail(answer, LACUNA_STOP, "nothing was measured");
    }
    if (!gather(l, known)) {
        end_likelihood(l);
        return lacuna_fail(answer, LACUNA_STOP, "a common error is of another shape than the response");
    }
    if (!read_unit(l, known->about)) {
        end_likelihood(l);
        return lacuna_fail(answer, LACUNA_STOP, "the response has no unit, or one that is too long");
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
    LACUNA_ENTRY("discrepancy", "plain_gaussian", component, discrepancy)
};

LACUNA_DECLARE("plain_gaussian", "1.0.0", LACUNA_PROVIDES("discrepancy", "plain_gaussian"), entries);

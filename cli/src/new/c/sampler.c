/* `skeleton`: random-walk Metropolis with step sizes from the prior.
 *
 * Each chain proposes a normal step of fixed width and accepts it with the ratio of the densities, or stays: exact from
 * the first step, without adaptation.
 *
 * Reference: Metropolis, Rosenbluth, Rosenbluth, Teller and Teller, J. Chem. Phys. 21 (1953) 1087.
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TWO_PI 6.283185307179586
/* Draws of the prior whose quantiles give the widths. */
#define DRAWS 1000

/* ---- texts ---- */

static int32_t say(const LacunaAnswer *answer, int32_t status, const char *text)
{
    lacuna_say(answer, text, strlen(text));
    return status;
}

static int32_t no_memory(const LacunaAnswer *answer)
{
    return say(answer, LACUNA_STOP, "there is no memory left");
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
    size_t chains, steps;
    double width;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, LACUNA_OK,
        "{\"type\":\"object\",\"description\":\"Random-walk Metropolis: each chain proposes a normal step of fixed width and "
        "accepts it with the ratio of the densities, or stays.\",\"additionalProperties\":false,\"properties\":{"
        "\"chains\":{\"type\":\"integer\",\"minimum\":2,\"default\":4,\"description\":\"Number of independent chains.\"},"
        "\"steps\":{\"type\":\"integer\",\"minimum\":1,\"default\":10000,\"description\":\"Number of steps of each chain.\"},"
        "\"width\":{\"type\":\"number\",\"exclusiveMinimum\":0,\"default\":0.5,\"description\":\"Standard deviation of a "
        "proposal in each unknown, as a fraction of that of its prior.\"}}}");
}

/* Reads a number if the options have the key; returns 0 if the value is none, or below the least. */
static int number(const char *options, const char *key, double least, int whole, double *value)
{
    char quoted[32], *end;
    const char *at;
    snprintf(quoted, sizeof quoted, "\"%s\":", key);
    at = strstr(options, quoted);
    if (at == NULL) {
        return 1;
    }
    at += strlen(quoted);
    *value = strtod(at, &end);
    return end != at && *value >= least && *value <= 1e15 && (!whole || floor(*value) == *value);
}

static int32_t wrong(const LacunaAnswer *answer, const char *key, const char *expected)
{
    char text[160];
    snprintf(text, sizeof text, "[{\"at\":\"%s\",\"message\":\"wrong value for `%s`\",\"expected\":\"%s\"}]", key, key,
             expected);
    return say(answer, LACUNA_REJECTED, text);
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    double chains = 4.0, steps = 10000.0, width = 0.5;
    char *text = copy_of(options);
    Plugin *plugin = malloc(sizeof *plugin);
    int32_t status = LACUNA_OK;
    if (text == NULL || plugin == NULL) {
        status = no_memory(answer);
    } else if (!number(text, "chains", 2.0, 1, &chains)) {
        status = wrong(answer, "chains", "a whole number from 2");
    } else if (!number(text, "steps", 1.0, 1, &steps)) {
        status = wrong(answer, "steps", "a whole number from 1");
    } else if (!number(text, "width", 1e-300, 0, &width)) {
        status = wrong(answer, "width", "a number above 0");
    } else {
        plugin->chains = (size_t)chains;
        plugin->steps = (size_t)steps;
        plugin->width = width;
        *out = plugin;
    }
    free(text);
    if (status != LACUNA_OK) {
        free(plugin);
    }
    return status;
}

/* All options with their defaults, which the record of a run keeps. */
static int32_t options(void *plugin, const LacunaAnswer *answer)
{
    const Plugin *p = plugin;
    char text[160];
    snprintf(text, sizeof text, "{\"chains\":%lu,\"steps\":%lu,\"width\":%.17g}", (unsigned long)p->chains,
             (unsigned long)p->steps, p->width);
    return say(answer, LACUNA_OK, text);
}

/* ---- the sampler ---- */

/* SplitMix64. All that is drawn follows from the key of the call, never from `rand` or a clock. */
static double uniform(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return ((double)((z ^ (z >> 31)) >> 11) + 0.5) / 9007199254740992.0;
}

/* By the method of Box and Muller. */
static double normal(uint64_t *state)
{
    const double radius = sqrt(-2.0 * log(uniform(state)));
    return radius * cos(TWO_PI * uniform(state));
}

static int32_t plan(void *plugin, size_t dimension, LacunaPlan *out, const LacunaAnswer *answer)
{
    const Plugin *p = plugin;
    (void)dimension;
    (void)answer;
    out->chains = p->chains;
    out->steps = p->steps;
    out->warm_up = 0;
    out->ensemble = 0;
    return LACUNA_OK;
}

static int32_t log_density(const LacunaTarget *target, const double *points, size_t rows, double *values,
                           const LacunaAnswer *answer)
{
    LacunaNumbers numbers;
    numbers.values = points;
    numbers.rows = rows;
    numbers.columns = target->dimension;
    return target->functions->log_density(target->target, numbers, values, answer);
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The memory of the run, a list: half the distance between the 16 % and 84 % quantiles of the prior of each unknown. */
static int32_t write_widths(const LacunaTarget *target, const LacunaAnswer *answer)
{
    const size_t dimension = target->dimension;
    /* Any fixed key serves: the draws only give a width. */
    const LacunaKey key = {{1, 2, 3, 4}};
    double *draws = malloc((dimension + 1) * DRAWS * sizeof *draws);
    double *column = draws == NULL ? NULL : draws + dimension * DRAWS;
    int32_t status;
    size_t i, j;
    if (draws == NULL) {
        return no_memory(answer);
    }
    status = target->functions->prior_draws(target->target, DRAWS, key, draws, answer);
    for (j = 0; status == LACUNA_OK && j < dimension; ++j) {
        char text[40];
        for (i = 0; i < DRAWS; ++i) {
            column[i] = draws[i * dimension + j];
        }
        qsort(column, DRAWS, sizeof *column, ascending);
        snprintf(text, sizeof text, "%s%.17g", j == 0 ? "[" : ",", 0.5 * (column[840] - column[160]));
        say(answer, LACUNA_OK, text);
    }
    free(draws);
    return status == LACUNA_OK ? say(answer, LACUNA_OK, "]") : status;
}

static int32_t start(void *plugin, const LacunaTarget *target, LacunaState *state, const LacunaAnswer *answer)
{
    const Plugin *p = plugin;
    int32_t status;
    size_t i;
    if (state->chains != p->chains || state->dimension != target->dimension) {
        return say(answer, LACUNA_STOP, "expected a starting point for each chain");
    }
    status = log_density(target, state->points, state->chains, state->log_density, answer);
    if (status != LACUNA_OK) {
        return status;
    }
    for (i = 0; i < state->chains; ++i) {
        if (!isfinite(state->log_density[i])) {
            return say(answer, LACUNA_STOP, "a chain starts where the density is zero");
        }
        state->accepted[i] = 0;
    }
    state->evaluations = state->chains;
    return write_widths(target, answer);
}

/* Moves each chain to its proposal or leaves it. */
static void choose(LacunaState *state, const double *tried, const double *density, uint64_t *random)
{
    const size_t dimension = state->dimension;
    size_t i;
    for (i = 0; i < state->chains; ++i) {
        state->accepted[i] = log(uniform(random)) < density[i] - state->log_density[i];
        if (state->accepted[i]) {
            memcpy(state->points + i * dimension, tried + i * dimension, dimension * sizeof *tried);
            state->log_density[i] = density[i];
        }
    }
}

static int32_t step(void *plugin, const LacunaTarget *target, LacunaState *state, LacunaKey key,
                    const LacunaAnswer *answer)
{
    const Plugin *p = plugin;
    const size_t dimension = state->dimension, chains = state->chains;
    uint64_t random = key.words[0];
    double *tried = malloc((dimension + 1) * chains * sizeof *tried);
    double *density = tried == NULL ? NULL : tried + dimension * chains;
    char *memory = copy_of(state->memory), *at = memory;
    int32_t status;
    size_t i, j;
    if (tried == NULL || memory == NULL) {
        free(tried);
        free(memory);
        return no_memory(answer);
    }
    for (j = 0; j < dimension; ++j) {
        /* Each number stands after a bracket or a comma. */
        const double width = *at == '\0' ? 0.0 : p->width * strtod(at + 1, &at);
        for (i = 0; i < chains; ++i) {
            tried[i * dimension + j] = state->points[i * dimension + j] + width * normal(&random);
        }
    }
    free(memory);
    status = log_density(target, tried, chains, density, answer);
    if (status == LACUNA_OK) {
        state->evaluations += chains;
        choose(state, tried, density, &random);
    }
    free(tried);
    return status;
}

/* A run may end after any number of steps. */
static int32_t steps_are_draws(void *plugin, uint8_t *draws, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)answer;
    *draws = 1;
    return LACUNA_OK;
}

/* ---- the library ---- */

static const LacunaComponentFunctions component = {
    .size = sizeof(LacunaComponentFunctions), .schema = schema, .create = create, .destroy = free, .options = options
};

static const LacunaSamplerFunctions sampler = {
    .size = sizeof(LacunaSamplerFunctions), .plan = plan, .start = start, .step = step,
    .steps_are_draws = steps_are_draws
};

static const LacunaEntry entries[] = {
    LACUNA_ENTRY("sampler", "skeleton", component, sampler)
};

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("sampler", "skeleton"), entries);

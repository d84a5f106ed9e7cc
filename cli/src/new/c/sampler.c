/* `skeleton`: random-walk Metropolis with step sizes from the prior.
 *
 * Each chain proposes a normal step of fixed width and accepts it with the ratio of the densities, or stays: exact from
 * the first step, without adaptation.
 *
 * Reference: Metropolis, Rosenbluth, Rosenbluth, Teller and Teller, J. Chem. Phys. 21 (1953) 1087.
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Draws of the prior whose quantiles give the widths. */
#define DRAWS 1000

/* ---- the options ---- */

typedef struct {
    size_t chains, steps;
    double width;
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return lacuna_say_text(answer,
        "{\"type\":\"object\",\"description\":\"Random-walk Metropolis: each chain proposes a normal step of fixed width and "
        "accepts it with the ratio of the densities, or stays.\",\"additionalProperties\":false,\"properties\":{"
        "\"chains\":{\"type\":\"integer\",\"minimum\":2,\"default\":4,\"description\":\"Number of independent chains.\"},"
        "\"steps\":{\"type\":\"integer\",\"minimum\":1,\"default\":10000,\"description\":\"Number of steps of each chain.\"},"
        "\"width\":{\"type\":\"number\",\"exclusiveMinimum\":0,\"default\":0.5,\"description\":\"Standard deviation of a "
        "proposal in each unknown, as a fraction of that of its prior.\"}}}");
}

/* 1 if a number is a whole one from the least on that any type holds. */
static int is_whole(double number, double least)
{
    return number >= least && number <= 1e15 && floor(number) == number;
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    const double chains = lacuna_json_number(lacuna_json(options, "chains"), 4.0);
    const double steps = lacuna_json_number(lacuna_json(options, "steps"), 10000.0);
    const double width = lacuna_json_number(lacuna_json(options, "width"), 0.5);
    Plugin *plugin;
    if (!is_whole(chains, 2.0)) {
        return lacuna_wrong_option(answer, "chains", "a whole number from 2");
    }
    if (!is_whole(steps, 1.0)) {
        return lacuna_wrong_option(answer, "steps", "a whole number from 1");
    }
    if (!(width > 0.0) || isinf(width)) {
        return lacuna_wrong_option(answer, "width", "a number above 0");
    }
    plugin = malloc(sizeof *plugin);
    if (plugin == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    plugin->chains = (size_t)chains;
    plugin->steps = (size_t)steps;
    plugin->width = width;
    *out = plugin;
    return LACUNA_OK;
}

/* All options with their defaults, which the record of a run keeps. */
static int32_t options(void *plugin, const LacunaAnswer *answer)
{
    const Plugin *p = plugin;
    lacuna_say_text(answer, "{\"chains\":");
    lacuna_say_number(answer, (double)p->chains);
    lacuna_say_text(answer, ",\"steps\":");
    lacuna_say_number(answer, (double)p->steps);
    lacuna_say_text(answer, ",\"width\":");
    lacuna_say_number(answer, p->width);
    return lacuna_say_text(answer, "}");
}

/* ---- the sampler ---- */

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
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    status = target->functions->prior_draws(target->target, DRAWS, key, draws, answer);
    for (j = 0; status == LACUNA_OK && j < dimension; ++j) {
        for (i = 0; i < DRAWS; ++i) {
            column[i] = draws[i * dimension + j];
        }
        qsort(column, DRAWS, sizeof *column, ascending);
        lacuna_say_text(answer, j == 0 ? "[" : ",");
        lacuna_say_number(answer, 0.5 * (column[840] - column[160]));
    }
    free(draws);
    return status == LACUNA_OK ? lacuna_say_text(answer, "]") : status;
}

static int32_t start(void *plugin, const LacunaTarget *target, LacunaState *state, const LacunaAnswer *answer)
{
    const Plugin *p = plugin;
    int32_t status;
    size_t i;
    if (state->chains != p->chains || state->dimension != target->dimension) {
        return lacuna_fail(answer, LACUNA_STOP, "expected a starting point for each chain");
    }
    status = log_density(target, state->points, state->chains, state->log_density, answer);
    if (status != LACUNA_OK) {
        return status;
    }
    for (i = 0; i < state->chains; ++i) {
        if (!isfinite(state->log_density[i])) {
            return lacuna_fail(answer, LACUNA_STOP, "a chain starts where the density is zero");
        }
        state->accepted[i] = 0;
    }
    state->evaluations = state->chains;
    return write_widths(target, answer);
}

/* Moves each chain to its proposal or leaves it. */
static void choose(LacunaState *state, const double *tried, const double *density, LacunaRandom *random)
{
    const size_t dimension = state->dimension;
    size_t i;
    for (i = 0; i < state->chains; ++i) {
        state->accepted[i] = log(lacuna_uniform(random)) < density[i] - state->log_density[i];
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
    /* All that is drawn follows from the key of the call, never from `rand` or a clock. */
    LacunaRandom random = lacuna_random(key);
    double *tried = malloc((dimension + 1) * chains * sizeof *tried);
    double *density = tried == NULL ? NULL : tried + dimension * chains;
    LacunaEach widths = lacuna_json_each(state->memory);
    int32_t status;
    size_t i, j;
    if (tried == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    for (j = 0; j < dimension; ++j) {
        const double width = lacuna_json_next(&widths) ? p->width * lacuna_json_number(widths.value, 0.0) : 0.0;
        for (i = 0; i < chains; ++i) {
            tried[i * dimension + j] = state->points[i * dimension + j] + width * lacuna_normal(&random);
        }
    }
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

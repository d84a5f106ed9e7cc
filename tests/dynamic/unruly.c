/* A model, a sampler and a surrogate that misbehave in the one way that the compiler is told. */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int object;

static int32_t say(const LacunaAnswer *answer, int32_t status, const char *text)
{
    lacuna_say(answer, text, strlen(text));
    return status;
}

/* Writes down what was ended, a letter a time. */
static void ended(int letter)
{
#ifdef ENDED
    FILE *file = fopen(ENDED, "a");
    /* The folder may be gone by now. */
    if (file != NULL) {
        fputc(letter, file);
        fclose(file);
    }
#else
    (void)letter;
#endif
}

static int32_t schema(const LacunaAnswer *answer)
{
#if defined(SCHEMA_IN_A_CIRCLE)
    return say(answer, LACUNA_OK,
        "{\"type\":\"object\",\"properties\":{\"a\":{\"$ref\":\"#/$defs/A\"},\"b\":{\"$ref\":\"#/$defs/B\"}},\"$defs\":{"
        "\"A\":{\"$ref\":\"#/$defs/A\"},\"B\":{\"type\":\"array\",\"items\":{\"$ref\":\"#/$defs/B\"}}}}");
#else
    return say(answer, LACUNA_OK, "{\"type\":\"object\",\"properties\":{}}");
#endif
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    (void)options;
#if defined(FAR_COMPLAINT)
    return say(answer, LACUNA_REJECTED,
        "[{\"at\":\"word\",\"message\":\"a bad word\",\"part\":{\"start\":18446744073709551615,\"end\":3}}]");
#else
    (void)answer;
    *out = &object;
    return LACUNA_OK;
#endif
}

static void destroy(void *plugin)
{
    (void)plugin;
}

static const LacunaComponentFunctions component = {
    .size = sizeof(LacunaComponentFunctions), .schema = schema, .create = create, .destroy = destroy
};

/* ---- the model ---- */

static int32_t signature(void *plugin, LacunaText context, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)context;
    return say(answer, LACUNA_OK, "{}");
}

static int32_t predict(void *plugin, const LacunaCalls *calls, double *responses, int32_t *statuses, uint8_t *valid,
                       const LacunaAnswer *answer)
{
    size_t i;
    (void)plugin;
#if defined(EXITS)
    exit(0);
#elif defined(ABORTS)
    abort();
#endif
    for (i = 0; i < calls->inputs.rows; ++i) {
#if !defined(NO_STATUS)
        statuses[i] = LACUNA_OK;
#endif
#if defined(ODD_STATUS)
        statuses[i] = 77;
#elif defined(NO_REASON)
        statuses[i] = LACUNA_REJECTED;
#endif
#if defined(ODD_MARK)
        valid[i] = 2;
#elif !defined(NO_MARK)
        valid[i] = 1;
#endif
#if !defined(NO_VALUE)
        responses[i] = 1.0;
#endif
    }
    (void)responses;
    (void)valid;
#if defined(SAYS_TOO_MUCH)
    return say(answer, LACUNA_OK, "[null,null,null,null,null]");
#else
    (void)answer;
    return LACUNA_OK;
#endif
}

static int32_t slopes_of_model(void *plugin, const LacunaCalls *calls, double *jacobian, const LacunaAnswer *answer)
{
    size_t i;
    (void)plugin;
    (void)answer;
    for (i = 0; i < calls->inputs.rows * calls->inputs.columns; ++i) {
        jacobian[i] = 2.0;
    }
    return LACUNA_OK;
}

static int32_t with_response(void *plugin, const LacunaCalls *calls, double *response, double *jacobian, uint8_t *valid,
                             const LacunaAnswer *answer)
{
    int32_t status;
#if defined(BOTH_REJECTED)
    return say(answer, LACUNA_REJECTED, "not both");
#elif defined(BOTH_ABSENT)
    return LACUNA_ABSENT;
#endif
    status = LACUNA_FATAL;
    predict(plugin, calls, response, &status, valid, answer);
#if defined(BOTH_SAY_TOO_MUCH)
    return say(answer, LACUNA_OK, "[null,null]");
#elif defined(NO_SLOPES)
    return LACUNA_OK;
#else
    return slopes_of_model(plugin, calls, jacobian, answer);
#endif
}

static const LacunaModelFunctions model = {
    .size = sizeof(LacunaModelFunctions), .signature = signature, .predict = predict, .jacobian = slopes_of_model,
    .with_response = with_response
};

/* ---- the sampler ---- */

static int32_t plan(void *plugin, size_t dimension, LacunaPlan *out, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)dimension;
    (void)answer;
    out->chains = 2;
    out->steps = 3;
    out->warm_up = 0;
    out->ensemble = 0;
#if defined(ENDLESS_PLAN)
    out->chains = out->steps = SIZE_MAX / 2;
#elif defined(EMPTY_PLAN)
    out->steps = 0;
#elif defined(ODD_PLAN)
    out->ensemble = 9;
#endif
    return LACUNA_OK;
}

static int32_t start(void *plugin, const LacunaTarget *target, LacunaState *state, const LacunaAnswer *answer)
{
    size_t i;
    (void)plugin;
#if defined(ASKS_NOWHERE)
    {
        LacunaNumbers nowhere = {NULL, 2, 1};
        return target->functions->log_density(target->target, nowhere, state->log_density, answer);
    }
#elif defined(ASKS_ASKEW)
    {
        LacunaNumbers wide = {NULL, 1, 7};
        wide.values = state->points;
        return target->functions->log_density(target->target, wide, state->log_density, answer);
    }
#elif defined(ASKS_FOR_ALL)
    {
        LacunaKey key = {{1, 2, 3, 4}};
        return target->functions->prior_draws(target->target, SIZE_MAX / 2, key, state->points, answer);
    }
#endif
    (void)target;
    (void)answer;
    for (i = 0; i < state->chains; ++i) {
        state->log_density[i] = -1.0;
        state->accepted[i] = 0;
    }
#if defined(ENDLESS_DENSITY)
    state->log_density[0] = INFINITY;
#elif defined(ENDLESS_POINT)
    state->points[0] = -INFINITY;
#elif defined(ODD_ACCEPTED)
    state->accepted[1] = 3;
#endif
    return LACUNA_OK;
}

static int32_t step(void *plugin, const LacunaTarget *target, LacunaState *state, LacunaKey key, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)target;
    (void)state;
    (void)key;
    (void)answer;
    return LACUNA_OK;
}

static int32_t uses_starts(void *plugin, uint8_t *uses, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)answer;
#if defined(ODD_USES)
    *uses = 2;
#elif !defined(NO_USES)
    *uses = 0;
#endif
    return LACUNA_OK;
}

static int32_t start_where(void *plugin, const LacunaAnswer *answer)
{
    (void)plugin;
#if defined(STARTS_NOWHERE)
    return say(answer, LACUNA_OK, "nowhere");
#elif defined(STARTS_UNSAID)
    return LACUNA_OK;
#else
    return say(answer, LACUNA_OK, "sobol");
#endif
}

static int32_t steps_are_draws(void *plugin, uint8_t *draws, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)answer;
#if defined(ODD_DRAWS)
    *draws = 9;
#elif defined(DRAWS_STOP)
    return say(answer, LACUNA_STOP, "draws or not");
#else
    *draws = 1;
#endif
    return LACUNA_OK;
}

static int32_t statistics(void *plugin, const LacunaState *state, const LacunaAnswer *answer)
{
    double values[4] = {0.0, 1.0, 3.0, 4.0};
    (void)plugin;
#if defined(ODD_FLAG)
    values[1] = 0.5;
#elif defined(ODD_COUNT)
    values[3] = -4.0;
#endif
#if defined(SHORT_STATISTICS)
    lacuna_give(answer, values, 2, 1);
#elif defined(FEW_STATISTICS)
    lacuna_give(answer, values, 1, state->chains);
#elif !defined(NO_STATISTICS)
    lacuna_give(answer, values, 2, state->chains);
#endif
#if defined(ODD_KIND)
    return say(answer, LACUNA_OK, "[{\"name\":\"a\",\"kind\":\"colour\"},{\"name\":\"b\",\"kind\":\"count\"}]");
#elif defined(SAME_NAMES)
    return say(answer, LACUNA_OK, "[{\"name\":\"a\",\"kind\":\"flag\"},{\"name\":\"a\",\"kind\":\"count\"}]");
#else
    return say(answer, LACUNA_OK, "[{\"name\":\"a\",\"kind\":\"flag\"},{\"name\":\"b\",\"kind\":\"count\"}]");
#endif
}

static const LacunaSamplerFunctions sampler = {
    .size = sizeof(LacunaSamplerFunctions), .plan = plan, .start = start, .step = step, .uses_starts = uses_starts,
    .start_where = start_where, .steps_are_draws = steps_are_draws, .statistics = statistics
};

/* ---- the surrogate: everything is zero ---- */

static const double zeros[1000];

static void end_emulator(void *emulator)
{
    (void)emulator;
    ended('e');
}

static int32_t mean(void *emulator, LacunaNumbers points, double *values, const LacunaAnswer *answer)
{
    (void)emulator;
    (void)answer;
    values[0] = 0.0 * (double)points.rows;
    return LACUNA_OK;
}

static int32_t fit_error(void *emulator, const LacunaAnswer *answer)
{
    (void)emulator;
#if defined(SHORT_RESIDUALS)
    lacuna_give(answer, zeros, 1, 1);
    lacuna_give(answer, zeros, 2, 1);
#elif defined(WIDE_ERRORS)
    lacuna_give(answer, zeros, 1, 3);
    lacuna_give(answer, zeros, 6, 1);
#else
    lacuna_give(answer, zeros, 1, 1);
    lacuna_give(answer, zeros, 6, 1);
#endif
    return LACUNA_OK;
}

static int32_t save(void *emulator, const LacunaAnswer *answer)
{
    (void)emulator;
    (void)answer;
    return LACUNA_OK;
}

static int32_t basis(void *map, LacunaNumbers points, double *values, const LacunaAnswer *answer)
{
    (void)map;
    (void)points;
    (void)values;
    (void)answer;
    return LACUNA_OK;
}

static const LacunaLinearFunctions linear_functions = {
    sizeof(LacunaLinearFunctions), basis, basis, NULL
};

static int32_t linear(void *emulator, LacunaLinear *out, const LacunaAnswer *answer)
{
    (void)answer;
    out->map = emulator;
    out->functions = &linear_functions;
    out->coefficients.values = zeros;
    out->coefficients.rows = 2;
    out->coefficients.columns = 1;
#if defined(NO_COEFFICIENTS)
    out->coefficients.values = NULL;
#elif defined(WIDE_COEFFICIENTS)
    out->coefficients.columns = 4;
#elif defined(ENDLESS_COEFFICIENTS)
    out->coefficients.rows = SIZE_MAX;
#endif
    return LACUNA_OK;
}

static int32_t mean_and_jacobian(void *emulator, LacunaNumbers point, const size_t *parameters, size_t count, double *values,
                                 double *slopes, const LacunaAnswer *answer)
{
    size_t i;
#if defined(NO_MEANS)
    (void)values;
#else
    values[0] = 7.0;
#endif
    for (i = 0; i < count; ++i) {
#if !defined(NO_EMULATOR_SLOPES)
        slopes[i] = parameters == NULL ? 1.0 : 2.0 + (double)parameters[i];
#endif
    }
    (void)emulator;
    (void)point;
    (void)answer;
    return LACUNA_OK;
}

static const LacunaEmulatorFunctions emulator_functions = {
    .size = sizeof(LacunaEmulatorFunctions), .destroy = end_emulator, .mean = mean, .jacobian = mean,
    .fit_error = fit_error,
#ifndef EMULATOR_LACKS
    .save = save,
#endif
    .linear = linear, .mean_and_jacobian = mean_and_jacobian
};

static int32_t fit(void *plugin, const LacunaTraining *training, LacunaKey key, const LacunaProgress *progress,
                   LacunaEmulator *out, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)key;
    (void)progress;
    (void)answer;
    out->size = sizeof *out;
    out->emulator = &object;
    out->functions = &emulator_functions;
    out->dimension = training->points.columns;
    out->outputs = training->responses.columns;
#ifdef WIDE_EMULATOR
    out->outputs += 1;
#endif
    return LACUNA_OK;
}

static int32_t load(void *plugin, LacunaText bytes, LacunaEmulator *out, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)bytes;
    (void)out;
    (void)answer;
    return LACUNA_ABSENT;
}

static int32_t sum(void *plugin, const LacunaSummand *parts, size_t count, LacunaNumbers offset, LacunaEmulator *out,
                   const LacunaAnswer *answer)
{
    (void)plugin;
    (void)parts;
    (void)count;
#if defined(SUM_STOPS)
    return say(answer, LACUNA_STOP, "nothing adds up");
#elif defined(SUM_ABSENT)
    return LACUNA_ABSENT;
#elif defined(SUM_OF_NOTHING)
    return LACUNA_OK;
#endif
    (void)answer;
    out->size = sizeof *out;
    out->emulator = &object;
    out->functions = &emulator_functions;
    out->dimension = 1;
    out->outputs = offset.columns;
#ifdef WIDE_SUM
    out->outputs += 1;
#endif
    return LACUNA_OK;
}

static const LacunaSurrogateFunctions surrogate = {
    .size = sizeof(LacunaSurrogateFunctions), .fit = fit, .load = load, .sum = sum
};

/* ---- the design: everything is in the middle ---- */

static int32_t points(void *plugin, size_t count, size_t dimension, LacunaKey key, double *to, const LacunaAnswer *answer)
{
    size_t i;
    (void)plugin;
    (void)key;
    (void)answer;
    for (i = 0; i < count * dimension; ++i) {
        to[i] = 0.5;
    }
    return LACUNA_OK;
}

static int32_t extend(void *plugin, LacunaText parameters, LacunaNumbers known, size_t count, LacunaKey key, double *to,
                      const LacunaAnswer *answer)
{
    (void)parameters;
#if defined(EXTEND_STOPS)
    return say(answer, LACUNA_STOP, "it is full\nhelp: begin anew");
#elif defined(EXTEND_ABSENT)
    return LACUNA_ABSENT;
#elif defined(EXTEND_UNWRITTEN)
    return LACUNA_OK;
#endif
    points(plugin, count, known.columns, key, to, answer);
#ifdef EXTEND_OUTSIDE
    to[1] = 1.0;
#endif
    return LACUNA_OK;
}

static const LacunaDesignFunctions design = {
    .size = sizeof(LacunaDesignFunctions), .points = points, .extend = extend
};

/* ---- the reader: two replicates of two values ---- */

static int32_t recognises(void *plugin, LacunaText path, LacunaText head)
{
    (void)plugin;
    (void)path;
    (void)head;
    return 0;
}

static int32_t inspect(void *plugin, LacunaText path, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)path;
    return say(answer, LACUNA_OK, "{}");
}

static int32_t names_files(void *plugin)
{
    (void)plugin;
    return 1;
}

static int32_t files(void *plugin, LacunaText source, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)source;
    return say(answer, LACUNA_OK, "[]");
}

static int32_t measurements(void *plugin, LacunaText source, const LacunaAnswer *answer)
{
    static const double values[] = {1.0, 2.0, 3.0, 4.0};
    double sd[] = {0.1, 0.2, 0.3, 0.4}, covariance[] = {1.0, 0.5, 0.5, 1.0};
    (void)plugin;
    (void)source;
    lacuna_give(answer, values, 2, 2);
#if defined(PART_OF_A_DEVIATION)
    sd[1] = NAN;
#elif defined(DEVIATION_BELOW_ZERO)
    sd[3] = -0.4;
#elif defined(NO_DEVIATIONS)
    sd[2] = sd[3] = NAN;
#elif defined(ASKEW_COVARIANCE)
    covariance[1] = 0.4;
#elif defined(VARIANCE_BELOW_ZERO)
    covariance[3] = -1.0;
#elif defined(ENDLESS_COVARIANCE)
    covariance[0] = INFINITY;
#endif
#if defined(FEW_DEVIATIONS)
    lacuna_give(answer, sd, 1, 2);
#else
    lacuna_give(answer, sd, 2, 2);
#endif
#if defined(WIDE_COVARIANCE)
    lacuna_give(answer, covariance, 1, 4);
#elif !defined(NO_COVARIANCE)
    lacuna_give(answer, covariance, 2, 2);
#endif
    return say(answer, LACUNA_OK, "{\"replicates\":[\"p\",\"q\"],\"sd\":true,\"covariance\":true}");
}

static int32_t allowed_failures(void *plugin, size_t runs, size_t *allowed, const LacunaAnswer *answer)
{
    (void)plugin;
#if defined(FAILURES_STOP)
    return say(answer, LACUNA_STOP, "none or all");
#elif !defined(NO_FAILURES)
    *allowed = runs / 2;
#endif
    (void)answer;
    return LACUNA_OK;
}

static const LacunaReaderFunctions reader = {
    .size = sizeof(LacunaReaderFunctions), .recognises = recognises, .inspect = inspect, .names_files = names_files,
    .files = files, .measurements = measurements, .allowed_failures = allowed_failures
};

/* ---- the library ---- */

static const LacunaEntry entries[] = {
    LACUNA_ENTRY("model", NAME, component, model),
    LACUNA_ENTRY("sampler", NAME, component, sampler),
    LACUNA_ENTRY("surrogate", NAME, component, surrogate),
    LACUNA_ENTRY("design", NAME, component, design),
    LACUNA_ENTRY("reader", NAME, component, reader)
};

LACUNA_DECLARE(NAME, "1",
               LACUNA_PROVIDES("model", NAME) LACUNA_PROVIDES("sampler", NAME) LACUNA_PROVIDES("surrogate", NAME)
               LACUNA_PROVIDES("design", NAME) LACUNA_PROVIDES("reader", NAME),
               entries);

/* A model, a sampler and a surrogate that misbehave in the one way that the compiler is told. */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
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
    sizeof(LacunaComponentFunctions), schema, create, destroy, NULL, NULL, NULL
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

static const LacunaModelFunctions model = {
    sizeof(LacunaModelFunctions), signature, predict, NULL, NULL, NULL, NULL, NULL
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

static const LacunaSamplerFunctions sampler = {
    sizeof(LacunaSamplerFunctions), plan, start, step, NULL, NULL, NULL, NULL, NULL
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

static const LacunaEmulatorFunctions emulator_functions = {
    sizeof(LacunaEmulatorFunctions), end_emulator, mean, mean, fit_error,
#ifdef EMULATOR_LACKS
    NULL,
#else
    save,
#endif
    NULL, linear, NULL, NULL
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

static const LacunaSurrogateFunctions surrogate = {
    sizeof(LacunaSurrogateFunctions), fit, load
};

/* ---- the library ---- */

static const LacunaEntry entries[] = {
    LACUNA_ENTRY("model", NAME, component, model),
    LACUNA_ENTRY("sampler", NAME, component, sampler),
    LACUNA_ENTRY("surrogate", NAME, component, surrogate)
};

LACUNA_DECLARE(NAME, "1", LACUNA_PROVIDES("model", NAME) LACUNA_PROVIDES("sampler", NAME) LACUNA_PROVIDES("surrogate", NAME),
               entries);

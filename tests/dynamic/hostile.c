/* A discrepancy that misbehaves in the one way that the compiler is told. */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdio.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#ifndef NO_SYMBOL

static int32_t say(const LacunaAnswer *answer, int32_t status, const char *text)
{
    lacuna_say(answer, text, strlen(text));
    return status;
}

static int object;

static int32_t schema(const LacunaAnswer *answer)
{
#if defined(SCHEMA_IS_NONE)
    return say(answer, LACUNA_OK, "no schema");
#elif defined(SCHEMA_IS_DEEP)
    int i;
    lacuna_say(answer, "{\"properties\":", 14);
    for (i = 0; i < 100000; ++i) {
        lacuna_say(answer, "[", 1);
    }
    return LACUNA_OK;
#else
    return say(answer, LACUNA_OK, "{\"type\":\"object\",\"properties\":{}}");
#endif
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    (void)options;
    (void)answer;
    *out = &object;
    return LACUNA_OK;
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

static void destroy(void *plugin)
{
    (void)plugin;
    ended('p');
}

static void destroy_likelihood(void *likelihood)
{
    (void)likelihood;
    ended('l');
}

static int32_t hyperparameters(void *likelihood, const LacunaAnswer *answer)
{
    (void)likelihood;
#if defined(NOT_JSON)
    return say(answer, LACUNA_OK, "[{\"name\": ");
#elif defined(NOT_TEXT)
    lacuna_say(answer, "\xff\xfe\xfd", 3);
    return LACUNA_OK;
#elif defined(ENDLESS_TEXT)
    lacuna_say(answer, "[]", (size_t)-1);
    return LACUNA_OK;
#elif defined(NO_TEXT)
    lacuna_say(answer, NULL, 2);
    return LACUNA_OK;
#elif defined(ONE_NAME)
#define UNKNOWN "{\"name\":\"v\",\"symbol\":\"v\",\"unit\":\"1\",\"prior\":{\"half_normal\":1.0},\"log\":true,\"start\":1.0}"
    return say(answer, LACUNA_OK, "[" UNKNOWN "," UNKNOWN "]");
#else
    return say(answer, LACUNA_OK,
        "[{\"name\":\"v\",\"symbol\":\"v\",\"unit\":\"1\",\"prior\":{\"half_normal\":1.0},\"log\":true,\"start\":1.0}]");
#endif
}

static int32_t log_likelihood(void *likelihood, LacunaNumbers responses, LacunaNumbers hyper, double *values,
                              const LacunaAnswer *answer)
{
    size_t i;
    (void)likelihood;
    (void)hyper;
#ifdef VALUES_REJECTED
    return say(answer, LACUNA_REJECTED, "not today");
#endif
    for (i = 0; i < responses.rows; ++i) {
#if defined(NAN_VALUES)
        values[i] = NAN;
#elif defined(ENDLESS_VALUES)
        values[i] = INFINITY;
#elif !defined(UNWRITTEN)
        values[i] = -1.0;
#endif
    }
    (void)answer;
    (void)values;
    return LACUNA_OK;
}

static int32_t gradient(void *likelihood, LacunaNumbers responses, LacunaNumbers hyper, double *by_response,
                        double *by_hyper, const LacunaAnswer *answer)
{
    size_t i;
    (void)likelihood;
    (void)answer;
    for (i = 0; i < responses.rows * responses.columns; ++i) {
#ifdef NAN_SLOPES
        by_response[i] = NAN;
#else
        by_response[i] = 0.0;
#endif
    }
    for (i = 0; i < hyper.rows * hyper.columns; ++i) {
        by_hyper[i] = 0.0;
    }
    return LACUNA_OK;
}

static int32_t predictive(void *likelihood, LacunaNumbers response, LacunaNumbers hyper, const LacunaAnswer *answer)
{
    static const double ones[] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1}, below[] = {1, 1, 1, 1, -1, 1, 1, 1, 1, 1};
    (void)below;
    (void)likelihood;
    (void)response;
    (void)hyper;
#if defined(SHORT_PARTS)
    lacuna_give(answer, ones, 1, 3);
#elif defined(ENDLESS_PARTS)
    lacuna_give(answer, ones, (size_t)-1 / 4, 10);
#elif defined(PARTS_NOWHERE)
    lacuna_give(answer, NULL, 1, 10);
#elif defined(PARTS_ASKEW)
    lacuna_give(answer, (const double *)(const void *)((const char *)ones + 1), 1, 9);
#elif defined(PARTS_BELOW_ZERO)
    lacuna_give(answer, below, 1, 10);
#elif !defined(NO_PARTS)
    lacuna_give(answer, ones, 1, 10);
#endif
    (void)ones;
    return say(answer, LACUNA_OK, "[\"discrepancy\"]");
}

static int32_t simulate(void *likelihood, LacunaNumbers response, LacunaNumbers hyper, LacunaKey key, double *values,
                        const LacunaAnswer *answer)
{
    (void)likelihood;
    (void)response;
    (void)hyper;
    (void)key;
    (void)answer;
#ifdef NAN_DATA
    values[0] = NAN;
#endif
    (void)values;
    return LACUNA_OK;
}

static int32_t left_out(void *likelihood, LacunaNumbers response, LacunaNumbers hyper, const LacunaAnswer *answer)
{
    static const double ones[] = {1, 1, 1};
    (void)likelihood;
    (void)response;
    (void)hyper;
#ifdef SHORT_LEFT_OUT
    lacuna_give(answer, ones, 1, 3);
    return LACUNA_OK;
#else
    (void)ones;
    (void)answer;
    return LACUNA_ABSENT;
#endif
}

static int32_t sampled_errors(void *likelihood, LacunaNumbers hyper, const LacunaAnswer *answer)
{
    static const double numbers[] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1}, below[] = {1, 1, -1, 1, 1, 1, 1, 1, 1, 1};
    (void)likelihood;
    (void)hyper;
    (void)numbers;
    (void)below;
#if defined(SHORT_SAMPLED)
    lacuna_give(answer, numbers, 1, 10);
    lacuna_give(answer, numbers, 9, 1);
    lacuna_give(answer, numbers, 10, 1);
    return LACUNA_OK;
#elif defined(SAMPLED_BELOW_ZERO)
    lacuna_give(answer, below, 1, 10);
    lacuna_give(answer, numbers, 10, 1);
    lacuna_give(answer, numbers, 10, 1);
    return LACUNA_OK;
#else
    (void)answer;
    return LACUNA_ABSENT;
#endif
}

/* A table may be that of an earlier version, without the functions that came later, or of a later one. */
#if defined(EARLIER_TABLE)
#define TABLE_SIZE offsetof(LacunaLikelihoodFunctions, left_out)
#elif defined(LATER_TABLE)
#define TABLE_SIZE (sizeof(LacunaLikelihoodFunctions) + sizeof(size_t))
#elif defined(HALF_A_TABLE)
#define TABLE_SIZE (offsetof(LacunaLikelihoodFunctions, gradient) + 4)
#else
#define TABLE_SIZE sizeof(LacunaLikelihoodFunctions)
#endif

static const struct {
    LacunaLikelihoodFunctions known;
    size_t later;
} likelihood_table = {{
    TABLE_SIZE, destroy_likelihood, hyperparameters, log_likelihood,
#ifdef LIKELIHOOD_LACKS
    NULL,
#else
    gradient,
#endif
    predictive, simulate, left_out, NULL, NULL, sampled_errors, NULL
}, (size_t)-1};

static int32_t likelihood(void *plugin, const LacunaKnown *known, LacunaLikelihood *out, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)known;
    (void)answer;
#if defined(LIKELIHOOD_STOPS)
    return say(answer, LACUNA_STOP, "there is nothing to do");
#elif defined(LIKELIHOOD_FAILS_SILENTLY)
    return LACUNA_STOP;
#elif defined(LIKELIHOOD_ABSENT)
    return LACUNA_ABSENT;
#elif defined(ODD_STATUS)
    return 77;
#endif
#ifndef LIKELIHOOD_MAKES_NOTHING
    out->size = sizeof *out;
#ifdef NO_LIKELIHOOD
    out->likelihood = NULL;
#else
    out->likelihood = &object;
#endif
    out->functions = &likelihood_table.known;
#endif
    (void)out;
    (void)likelihood_table;
    return LACUNA_OK;
}

static int32_t likelihood_of_part(void *plugin, const LacunaKnown *known, const LacunaKnown *part, LacunaLikelihood *out,
                                  const LacunaAnswer *answer)
{
    (void)part;
#if defined(PART_STOPS)
    return say(answer, LACUNA_STOP, "no part is whole");
#elif defined(PART_ABSENT)
    return LACUNA_ABSENT;
#elif defined(PART_MAKES_NOTHING)
    return LACUNA_OK;
#endif
    return likelihood(plugin, known, out, answer);
}

static int32_t takes_stated_noise(void *plugin, uint8_t *takes, const LacunaAnswer *answer)
{
    (void)plugin;
#if defined(TAKES_STOPS)
    return say(answer, LACUNA_STOP, "who knows");
#elif defined(ODD_TAKES)
    *takes = 7;
#elif !defined(NO_TAKES)
    *takes = 1;
#endif
    (void)takes;
    (void)answer;
    return LACUNA_OK;
}

static uint32_t revision(void)
{
#if defined(NO_REVISION)
    return 0;
#else
    return 5;
#endif
}

static const LacunaComponentFunctions component = {
#ifdef FIRST_VERSION
    .size = offsetof(LacunaComponentFunctions, revision),
#else
    .size = sizeof(LacunaComponentFunctions),
#endif
    .schema = schema, .create = create, .destroy = destroy, .revision = revision
};

static const LacunaDiscrepancyFunctions discrepancy = {
#ifdef FIRST_VERSION
    .size = offsetof(LacunaDiscrepancyFunctions, likelihood_of_part),
#else
    .size = sizeof(LacunaDiscrepancyFunctions),
#endif
#ifndef NO_FUNCTION
    .likelihood = likelihood,
#endif
    .likelihood_of_part = likelihood_of_part, .takes_stated_noise = takes_stated_noise
};

#ifdef WRONG_KIND
#define KIND "oracle"
#else
#define KIND "discrepancy"
#endif

#if defined(NAME_TAKEN)
#define CALLED "gaussian"
#elif defined(BAD_NAME)
#define CALLED "Bad name"
#else
#define CALLED NAME
#endif

static const LacunaEntry entries[] = {
    LACUNA_ENTRY(KIND, CALLED, component, discrepancy)
#ifdef TWICE
    , LACUNA_ENTRY(KIND, CALLED, component, discrepancy)
#endif
};

#ifdef DOES_NOT_START
static int32_t start(const LacunaHost *host)
{
    (void)host;
    return LACUNA_STOP;
}
#else
#define start NULL
#endif

#ifdef WRONG_MAGIC
#define MAGIC 7
#else
#define MAGIC LACUNA_MAGIC
#endif

#ifdef WRONG_MAJOR
#define MAJOR 9u
#else
#define MAJOR LACUNA_MAJOR
#endif

#if defined(NEWER_MINOR)
#define MINOR 99u
#elif defined(FIRST_VERSION)
#define MINOR 0u
#else
#define MINOR LACUNA_MINOR
#endif

#ifdef SMALL_DECLARATION
#define SIZE 8
#else
#define SIZE sizeof(LacunaDeclaration)
#endif

#ifdef ABORTS
#define UNWINDS 0u
#else
#define UNWINDS 1u
#endif

#ifdef NO_ENTRIES
#define COUNT 0
#else
#define COUNT (sizeof entries / sizeof entries[0])
#endif

LACUNA_EXPORT const LacunaDeclaration lacuna_plugin = {
    MAGIC, MAJOR, MINOR, SIZE, UNWINDS, COUNT, LACUNA_TEXT(NAME), LACUNA_TEXT("1"), LACUNA_TEXT("C"), entries,
    LACUNA_TEXT(LACUNA_RECORD_BEGIN LACUNA_PROVIDES(KIND, CALLED) "end\n"), start
};

#else
int nothing;
#endif

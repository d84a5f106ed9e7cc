/* Plugins for Lacuna in C.
 *
 * Written from the program's own declarations; docs/abi.md tells what holds at this boundary. In short: who allocates
 * frees; what a call is given belongs to the caller and is there until the call returns; results go into buffers of the
 * caller or through its answer; nothing unwinds; objects may be used from several threads at once.
 *
 * Behind the tables are functions that read JSON (`lacuna_json…`), write an answer (`lacuna_say…`, `lacuna_give`) and draw
 * random numbers (`lacuna_random` and the following).
 */
#ifndef LACUNA_PLUGIN_H
#define LACUNA_PLUGIN_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

#define LACUNA_MAGIC UINT64_C(0x6c6163756e61706c)
#define LACUNA_MAJOR 1u
#define LACUNA_MINOR 2u

/* What a function returns. */
enum {
    /* All is well. */
    LACUNA_OK = 0,
    /* No answer for these arguments; others may do. The text says why. */
    LACUNA_REJECTED = 1,
    /* No answer for any arguments. The text says why. */
    LACUNA_FATAL = 2,
    /* The stage cannot go on. The text says why. */
    LACUNA_STOP = 3,
    /* The code panicked. The text is its message. */
    LACUNA_PANIC = 4,
    /* The plugin does not have this; all is well. */
    LACUNA_ABSENT = 5,
    LACUNA_STATUS_END
};

/* Text in UTF-8, or bytes, without a zero at the end. Structured data are JSON. */
typedef struct LacunaText {
    /* The first byte; may be null when there is none. */
    const uint8_t *bytes;
    /* The number of bytes. */
    size_t length;
} LacunaText;

/* A matrix of numbers row by row: entry `(i, j)` is `values[i * columns + j]`. One point, one response a row. */
typedef struct LacunaNumbers {
    /* The first number; may be null when there is none. */
    const double *values;
    /* The number of rows. */
    size_t rows;
    /* The number of columns. */
    size_t columns;
} LacunaNumbers;

/* The name of a stream of random numbers: one key, one sequence. What is drawn must depend on the key alone. */
typedef struct LacunaKey {
    /* The words of the key, any of which is a good seed. */
    uint64_t words[4];
} LacunaKey;

/* Takes results of a length that the caller does not know, and the message of an error. What is given to it is
 * copied before it returns. It is there for the time of one call and used by one thread. */
typedef struct LacunaAnswer {
    /* The size of this struct in bytes. */
    size_t size;
    /* Whatever the functions need. */
    void *context;
    /* Appends to the text of the answer. */
    void (*text)(void *context, LacunaText text);
    /* Adds a matrix to the answer. */
    void (*numbers)(void *context, LacunaNumbers numbers);
} LacunaAnswer;

/* The functions of plugins of all kinds: they are made from options, and check themselves. */
typedef struct LacunaComponentFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Answers the JSON Schema (2020-12) of the options: an object with `properties`, each with a `description`, and
     * `required`. With `"additionalProperties": false` keys that it does not list are refused before `create`. */
    int32_t (*schema)(const LacunaAnswer *answer);
    /* Makes a plugin from its options, a JSON object, and puts it into `out`. Options that are wrong are
     * `REJECTED`, with the reason as text, or with a JSON list of complaints `{"at": "degree.max", "message": "…",
     * "expected": "…", "found": "…", "help": ["…"]}`. A number that is not finite is written `{"float": "inf"}`,
     * `"-inf"` or `"nan"`. */
    int32_t (*create)(LacunaText options, void **out, const LacunaAnswer *answer);
    /* Ends a plugin. */
    void (*destroy)(void *plugin);
    /* Answers all options with the defaults filled in, a JSON object; as they were given where it is null. */
    /* May be null. */
    int32_t (*options)(void *plugin, const LacunaAnswer *answer);
    /* Checks the options against the rest of the study and answers a JSON list of complaints; none when it writes
     * nothing. `context` is described in `docs/abi.md`. No files are touched. */
    /* May be null. */
    int32_t (*check)(void *plugin, LacunaText context, const LacunaAnswer *answer);
    /* Checks the options against the machine: files, commands. Nothing is changed. */
    /* May be null. */
    int32_t (*environment)(void *plugin, LacunaText context, const LacunaAnswer *answer);
    /* The revision of the plugin, a number from 1 that its author raises whenever what it computes changes; 1 where
     * it is null. Since version 1.1. */
    /* May be null. */
    uint32_t (*revision)(void);
} LacunaComponentFunctions;

/* A sum of squares `|R (psi(x), 1)|^2` as a function of the point. */
typedef struct LacunaSquaresFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Ends it. */
    void (*destroy)(void *squares);
    /* The sum at each point. */
    int32_t (*values)(void *squares, LacunaNumbers points, double *values, const LacunaAnswer *answer);
    /* The derivatives at each point, `points x parameters`. */
    int32_t (*gradient)(void *squares, LacunaNumbers points, double *gradient, const LacunaAnswer *answer);
    /* 1 where the form holds at all of these points to its error, else 0. */
    int32_t (*covers)(void *squares, LacunaNumbers points);
} LacunaSquaresFunctions;

/* A sum of squares of linear combinations of basis functions. */
typedef struct LacunaSquares {
    /* The size of this struct in bytes. */
    size_t size;
    /* The first argument of the functions. */
    void *squares;
    /* The functions. */
    const LacunaSquaresFunctions *functions;
    /* The largest difference from the product's own sum of squares that round-off makes. */
    double error;
} LacunaSquares;

/* A forward map `y(x) = C' psi(x)`. */
typedef struct LacunaLinearFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* The basis functions at each point, `points x terms`. */
    int32_t (*basis)(void *map, LacunaNumbers points, double *basis, const LacunaAnswer *answer);
    /* The derivative of each basis function (rows) by each parameter (columns) at one point. */
    int32_t (*basis_gradient)(void *map, LacunaNumbers point, double *gradient, const LacunaAnswer *answer);
    /* The form of `|R (psi(x), 1)|^2` for a factor `R` (any number of rows, `terms + 1` columns) that takes fewer
     * operations than the product; `ABSENT` where there is none. The caller ends it. */
    /* May be null. */
    int32_t (*sum_of_squares)(void *map, LacunaNumbers factor, LacunaSquares *out, const LacunaAnswer *answer);
} LacunaLinearFunctions;

/* A forward map `y(x) = C' psi(x)` with coefficients `C` (`terms x outputs`). */
typedef struct LacunaLinear {
    /* The size of this struct in bytes. */
    size_t size;
    /* The first argument of the functions. */
    void *map;
    /* The functions. */
    const LacunaLinearFunctions *functions;
    /* The coefficients, `terms x outputs`. */
    LacunaNumbers coefficients;
} LacunaLinear;

/* An error that all replicates share, a covariance `F F'`. */
typedef struct LacunaCommonErrorView {
    /* The origin: `emulator`, `numerics`, `replicates`. */
    LacunaText origin;
    /* The factor `F`, `outputs x rank`, in the response's unit. */
    LacunaNumbers factor;
    /* 1 where a new replicate has it too, beside what the discrepancy adds to a replicate. */
    uint8_t predictive;
} LacunaCommonErrorView;

/* Functions of the data. */
typedef struct LacunaKnownFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Answers the derivative of each output (rows) by each parameter (columns), in units of the prior's standard
     * deviation of that parameter, where the model fits the data best: one matrix. It costs an optimisation. */
    int32_t (*slopes)(void *known, const LacunaAnswer *answer);
} LacunaKnownFunctions;

/* The data from which a likelihood is made. It is there for the time of the call. */
typedef struct LacunaKnown {
    /* The size of this struct in bytes. */
    size_t size;
    /* The first argument of the functions. */
    void *known;
    /* The functions. */
    const LacunaKnownFunctions *functions;
    /* The shape of a complete measurement as JSON, and the names of the replicates: `{"layout": {…}, "replicates":
     * ["…"]}`. */
    LacunaText about;
    /* The measured values, `replicates x outputs`; zero where nothing was measured. */
    LacunaNumbers values;
    /* 1 where a value was measured, 0 where not, `replicates x outputs`. */
    const uint8_t *measured;
    /* The errors that all replicates share: their covariances are added once to that of the mean curve, never
     * divided by the number of replicates. */
    const LacunaCommonErrorView *common;
    /* The number of common errors. */
    size_t common_count;
    /* The standard deviation of the noise of each value, where the data state it: `replicates x outputs`, a row of
     * NaN for a replicate that states none, zero where nothing was measured; no rows where no replicate states any.
     * Since version 1.1. */
    LacunaNumbers sd;
    /* The covariance of the noise of one complete measurement, `outputs x outputs`, where the data state it; no
     * rows where they do not. Since version 1.1. */
    LacunaNumbers covariance;
} LacunaKnown;

/* A likelihood as a function of the basis functions of a linear emulator. */
typedef struct LacunaCompressedFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Ends it. */
    void (*destroy)(void *compressed);
    /* The log-likelihood for each row of `basis` (`points x terms`) and of `hyper`. */
    int32_t (*log_likelihood)(void *compressed, LacunaNumbers basis, LacunaNumbers hyper, double *values, const LacunaAnswer *answer);
    /* The derivatives at each row by the basis functions and by the hyperparameters. */
    int32_t (*gradient)(void *compressed, LacunaNumbers basis, LacunaNumbers hyper, double *by_basis, double *by_hyper, const LacunaAnswer *answer);
    /* The values of `log_likelihood` at points in physical units, for those who can do with less than all basis
     * functions. */
    /* May be null. */
    int32_t (*log_likelihood_at)(void *compressed, const LacunaLinear *linear, LacunaNumbers points, LacunaNumbers hyper, double *values, const LacunaAnswer *answer);
    /* The derivatives of `gradient`, by the parameters, at points in physical units. */
    /* May be null. */
    int32_t (*gradient_at)(void *compressed, const LacunaLinear *linear, LacunaNumbers points, LacunaNumbers hyper, double *by_points, double *by_hyper, const LacunaAnswer *answer);
} LacunaCompressedFunctions;

/* A likelihood reduced to a small form in the basis functions of a linear emulator. */
typedef struct LacunaCompressed {
    /* The size of this struct in bytes. */
    size_t size;
    /* The first argument of the functions. */
    void *compressed;
    /* The functions. */
    const LacunaCompressedFunctions *functions;
} LacunaCompressed;

/* The likelihood of fixed measurements as a function of the response (one value an output) and of the
 * hyperparameters, always for several points at once: one a row. */
typedef struct LacunaLikelihoodFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Ends it. */
    void (*destroy)(void *likelihood);
    /* Answers the unknowns beside the model's parameters, a JSON list of `{"name", "symbol", "unit", "prior",
     * "log", "start"}`. */
    int32_t (*hyperparameters)(void *likelihood, const LacunaAnswer *answer);
    /* The log-likelihood for each row; minus infinity outside the support, never NaN. */
    int32_t (*log_likelihood)(void *likelihood, LacunaNumbers responses, LacunaNumbers hyper, double *values, const LacunaAnswer *answer);
    /* The derivatives by the response and by the hyperparameters, one row a point. */
    int32_t (*gradient)(void *likelihood, LacunaNumbers responses, LacunaNumbers hyper, double *by_response, double *by_hyper, const LacunaAnswer *answer);
    /* Answers the variance of a new replicate around the response, split by origin: the origins as a JSON list, and
     * a matrix `origins x outputs`. */
    int32_t (*predictive)(void *likelihood, LacunaNumbers response, LacunaNumbers hyper, const LacunaAnswer *answer);
    /* Data as this discrepancy would have made them, `replicates x outputs`; what stands where nothing was measured
     * does not matter. */
    int32_t (*simulate)(void *likelihood, LacunaNumbers response, LacunaNumbers hyper, LacunaKey key, double *values, const LacunaAnswer *answer);
    /* Answers the log density of each measured value given all others, by replicate and output with gaps left out:
     * one row. `ABSENT` where there is no such form. */
    /* May be null. */
    int32_t (*left_out)(void *likelihood, LacunaNumbers response, LacunaNumbers hyper, const LacunaAnswer *answer);
    /* The likelihood as a function of the basis functions of a linear emulator; `ABSENT` where there is no such
     * form. */
    /* May be null. */
    int32_t (*compress)(void *likelihood, const LacunaLinear *linear, LacunaCompressed *out, const LacunaAnswer *answer);
    /* Answers what is worth telling, a JSON list of `{"name", "value"}`. */
    /* May be null. */
    int32_t (*facts)(void *likelihood, const LacunaAnswer *answer);
    /* Answers how it has the common errors, where it samples some of their directions and leaves the rest out: the
     * variance of the mean curve without them, one row, infinite where nothing was measured; the factor of the
     * errors that are sampled, `outputs x directions`; and of those that are left out, `outputs x any number`.
     * `ABSENT` where it has their whole covariance. Since version 1.1. */
    /* May be null. */
    int32_t (*sampled_errors)(void *likelihood, LacunaNumbers hyper, const LacunaAnswer *answer);
    /* Writes 1 where value and gradient take a number of operations proportional to the number of data, so that
     * they can be computed many times for each response of the model; 0, or null, where not. Since version 1.2. */
    /* May be null. */
    int32_t (*is_cheap)(void *likelihood, uint8_t *cheap, const LacunaAnswer *answer);
} LacunaLikelihoodFunctions;

/* The likelihood of fixed measurements. */
typedef struct LacunaLikelihood {
    /* The size of this struct in bytes. */
    size_t size;
    /* The first argument of the functions. */
    void *likelihood;
    /* The functions. */
    const LacunaLikelihoodFunctions *functions;
} LacunaLikelihood;

/* A statistical model of the difference between model and data. */
typedef struct LacunaDiscrepancyFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* The likelihood of what is known. */
    int32_t (*likelihood)(void *plugin, const LacunaKnown *known, LacunaLikelihood *out, const LacunaAnswer *answer);
    /* Answers the standard deviation of one replicate around a response, where the options say how large it is: one
     * row, and a second one with the times over which correlations along the last axis fall by a factor e, where
     * values are not independent. `ABSENT` where the noise is unknown. */
    /* May be null. */
    int32_t (*stated_noise)(void *plugin, LacunaText layout, LacunaNumbers response, const LacunaAnswer *answer);
    /* The likelihood of a part of the known data, some of whose values are missing, under the law that stands for
     * all of them: what is estimated from the replicates is estimated from all. Of `part` only the data count.
     * Hyperparameters keep their names; one that belongs to missing values alone may be gone. `ABSENT` where there
     * is no such form. Since version 1.1. */
    /* May be null. */
    int32_t (*likelihood_of_part)(void *plugin, const LacunaKnown *known, const LacunaKnown *part, LacunaLikelihood *out, const LacunaAnswer *answer);
    /* Writes 1 where the likelihood uses the noise that the data state (`sd` and `covariance` of what is known), 0
     * where not; where it does not, or is null, such data are refused. Since version 1.1. */
    /* May be null. */
    int32_t (*takes_stated_noise)(void *plugin, uint8_t *takes, const LacunaAnswer *answer);
} LacunaDiscrepancyFunctions;

/* A log density for samplers to ask. */
typedef struct LacunaTargetFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* The log density at each point; minus infinity outside the support, never NaN. */
    int32_t (*log_density)(void *target, LacunaNumbers points, double *values, const LacunaAnswer *answer);
    /* The log prior density at each point. */
    int32_t (*log_prior)(void *target, LacunaNumbers points, double *values, const LacunaAnswer *answer);
    /* The log density at one point and its gradient. */
    int32_t (*gradient)(void *target, LacunaNumbers point, double *value, double *gradient, const LacunaAnswer *answer);
    /* The closed interval of each coordinate, infinite where it has no bound. */
    int32_t (*bounds)(void *target, double *low, double *high, const LacunaAnswer *answer);
    /* Independent draws from the prior, `count x dimension`. */
    int32_t (*prior_draws)(void *target, size_t count, LacunaKey key, double *points, const LacunaAnswer *answer);
    /* Answers why the density can no longer be computed; `ABSENT` while it can. */
    int32_t (*failure)(void *target, const LacunaAnswer *answer);
} LacunaTargetFunctions;

/* A log density to draw from. It is there for the time of the call. */
typedef struct LacunaTarget {
    /* The size of this struct in bytes. */
    size_t size;
    /* The first argument of the functions. */
    void *target;
    /* The functions. */
    const LacunaTargetFunctions *functions;
    /* The number of coordinates. */
    size_t dimension;
} LacunaTarget;

/* The size of a run. */
typedef struct LacunaPlan {
    /* The number of chains. */
    size_t chains;
    /* The number of steps of each. */
    size_t steps;
    /* The number of first steps in which the method adapts itself. */
    size_t warm_up;
    /* 1 where the chains are walkers of one ensemble, and so not independent of each other. */
    uint8_t ensemble;
} LacunaPlan;

/* The state of a sampler between two steps. The buffers are the caller's. */
typedef struct LacunaState {
    /* The size of this struct in bytes. */
    size_t size;
    /* The number of chains. */
    size_t chains;
    /* The number of coordinates. */
    size_t dimension;
    /* The point of each chain, `chains x dimension`. */
    double *points;
    /* The log density there. */
    double *log_density;
    /* 1 for each chain that moved in the last step. */
    uint8_t *accepted;
    /* Evaluations of the log density so far. */
    uint64_t evaluations;
    /* Whatever else the sampler keeps, as JSON. What a call writes as text of its answer takes its place. */
    LacunaText memory;
} LacunaState;

/* Draws from a log density step by step. All that a sampler remembers is in the state, so that a run that was
 * killed goes on with the same bits. */
typedef struct LacunaSamplerFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Writes the numbers of chains and steps that a run has on a density of this dimension. */
    int32_t (*plan)(void *plugin, size_t dimension, LacunaPlan *plan, const LacunaAnswer *answer);
    /* The state before the first step: its points are the starting points already. */
    int32_t (*start)(void *plugin, const LacunaTarget *target, LacunaState *state, const LacunaAnswer *answer);
    /* One step of all chains; the key belongs to this step alone. */
    int32_t (*step)(void *plugin, const LacunaTarget *target, LacunaState *state, LacunaKey key, const LacunaAnswer *answer);
    /* 1 where this state is the last one, however many steps the plan has. */
    /* May be null. */
    int32_t (*finished)(void *plugin, const LacunaState *state);
    /* Answers the draws of a method whose steps are no draws themselves: a matrix of points, a row of log
     * densities, and the JSON object `{"effective_size", "evidence", "doubts", "facts"}`. `ABSENT` where the points
     * of each step are draws. */
    /* May be null. */
    int32_t (*harvest)(void *plugin, const LacunaTarget *target, const LacunaState *state, LacunaKey key, const LacunaAnswer *answer);
    /* Answers reasons not to trust the draws of a run that ended in this state, a JSON list of texts. */
    /* May be null. */
    int32_t (*doubts)(void *plugin, const LacunaState *state, const LacunaAnswer *answer);
    /* Answers what a person should know of such a run, a JSON list of texts. */
    /* May be null. */
    int32_t (*notes)(void *plugin, const LacunaState *state, const LacunaAnswer *answer);
    /* Answers what is worth telling of the method, a JSON list of `{"name", "value"}`. */
    /* May be null. */
    int32_t (*facts)(void *plugin, const LacunaAnswer *answer);
    /* Writes 1 where the chains begin at the starting points that they are given, as they do where it is null; 0
     * for a method that draws its own from the prior. Since version 1.1. */
    /* May be null. */
    int32_t (*uses_starts)(void *plugin, uint8_t *uses, const LacunaAnswer *answer);
    /* Answers where the chains start when the study does not say: `map` (about the maximum of the posterior
     * density, as where it is null), `prior` or `sobol`. Since version 1.1. */
    /* May be null. */
    int32_t (*start_where)(void *plugin, const LacunaAnswer *answer);
    /* Writes 1 where the points of each step are draws, so that a run may end after any number of steps past the
     * warm-up; 0, or null, where they are not. Since version 1.1. */
    /* May be null. */
    int32_t (*steps_are_draws)(void *plugin, uint8_t *draws, const LacunaAnswer *answer);
    /* Answers what there is to tell of the last step of each chain beside its point: a JSON list of `{"name",
     * "kind"}` with the kind `flag` (0 or 1), `count` or `number`, and a matrix `statistics x chains`, NaN before
     * the first step. The same statistics in the same order of every state; `ABSENT` where there are none. Since
     * version 1.1. */
    /* May be null. */
    int32_t (*statistics)(void *plugin, const LacunaState *state, const LacunaAnswer *answer);
} LacunaSamplerFunctions;

/* Places points in the unit cube. */
typedef struct LacunaDesignFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Points in the open unit cube, `count x dimension`. */
    int32_t (*points)(void *plugin, size_t count, size_t dimension, LacunaKey key, double *points, const LacunaAnswer *answer);
    /* Points for these parameters, a JSON list: for a design whose points depend on the laws that will map them. */
    /* May be null. */
    int32_t (*place)(void *plugin, LacunaText parameters, size_t count, size_t dimension, LacunaKey key, double *points, const LacunaAnswer *answer);
    /* `count` further points beside those of `known` (one a row), which this design placed and which stay where
     * they are; the key is the one that placed them. `STOP` with the reason, or `ABSENT`, where it cannot go on.
     * Since version 1.1. */
    /* May be null. */
    int32_t (*extend)(void *plugin, LacunaText parameters, LacunaNumbers known, size_t count, LacunaKey key, double *points, const LacunaAnswer *answer);
} LacunaDesignFunctions;

/* Evaluations that are asked of a model, which differ in their inputs and folders only. */
typedef struct LacunaCalls {
    /* The size of this struct in bytes. */
    size_t size;
    /* The inputs, one call a row, in the order and the units of the signature. */
    LacunaNumbers inputs;
    /* The properties that all calls have in common, as JSON: `{"names", "units", "layout", "scenario", "study"}`. */
    LacunaText about;
    /* A folder of each call's own for files that are kept, a JSON list of paths or `null`. */
    LacunaText folders;
} LacunaCalls;

/* A simulator. */
typedef struct LacunaModelFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Answers what goes in and what comes out, as JSON: `{"inputs": [{"name", "unit", "default", "low", "high",
     * "description"}], "layout", "resamples"}`. `low` and `high` are `null` where there is no bound; an answer
     * without `inputs` or `layout` takes those of the study. */
    int32_t (*signature)(void *plugin, LacunaText context, const LacunaAnswer *answer);
    /* Runs the simulator: `calls x outputs` into `responses`. `statuses` has one status a call (`OK`, `REJECTED`,
     * `FATAL`), `valid` is 1 where a run stayed inside the model's range of validity. The text is a JSON list with
     * one `{"message", "facts"}` or `null` a call, or nothing. */
    int32_t (*predict)(void *plugin, const LacunaCalls *calls, double *responses, int32_t *statuses, uint8_t *valid, const LacunaAnswer *answer);
    /* The number of evaluations that are best asked for at once. */
    /* May be null. */
    size_t (*batch)(void *plugin);
    /* Answers the inputs on which no response depends, a JSON list of names. */
    /* May be null. */
    int32_t (*unused)(void *plugin, LacunaText context, const LacunaAnswer *answer);
    /* Answers the user's files that the answers depend on, a JSON list of paths; relative ones start in
     * `directory`. */
    /* May be null. */
    int32_t (*files)(void *plugin, LacunaText directory, const LacunaAnswer *answer);
    /* Writes a finished run (one call, its response, and `{"valid", "facts"}` about it) in the simulator's own
     * format into `directory` and answers the file's name; `ABSENT` when it has no format of its own. */
    /* May be null. */
    int32_t (*write)(void *plugin, LacunaText run, const LacunaCalls *calls, LacunaNumbers response, LacunaText about, LacunaText directory, const LacunaAnswer *answer);
    /* The derivatives of each value of the response (rows) by each input (columns), for one call. `ABSENT` where
     * they are not known. Without a call (no row of inputs, `jacobian` null) nothing is written: whether there are
     * derivatives is the question. */
    /* May be null. */
    int32_t (*jacobian)(void *plugin, const LacunaCalls *calls, double *jacobian, const LacunaAnswer *answer);
    /* The response of one call, as `predict` gives it, and its derivatives, as `jacobian` gives them, from one run;
     * `ABSENT` where that costs no less than asking for each. `valid` and the text are as those of `predict` for
     * this call. Since version 1.1. */
    /* May be null. */
    int32_t (*with_response)(void *plugin, const LacunaCalls *calls, double *response, double *jacobian, uint8_t *valid, const LacunaAnswer *answer);
} LacunaModelFunctions;

/* One candidate piece of missing physics on the model's response. Its first parameter is its size. `layout` is the
 * shape of a response as JSON. */
typedef struct LacunaEffectFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Answers what it is, as JSON: `{"title", "formula", "source", "reach"}`; the reach is `any`, `single` or
     * `whole`. */
    int32_t (*describe)(void *plugin, const LacunaAnswer *answer);
    /* Answers its unknowns, a JSON list as that of a likelihood's hyperparameters. */
    int32_t (*parameters)(void *plugin, LacunaText layout, const LacunaAnswer *answer);
    /* Answers the values at which it is absent: one row. */
    int32_t (*absent)(void *plugin, LacunaText layout, const LacunaAnswer *answer);
    /* The responses with the effect, one a row, for the values of each row. */
    int32_t (*apply)(void *plugin, LacunaText layout, LacunaNumbers responses, LacunaNumbers values, double *changed, const LacunaAnswer *answer);
    /* Answers values from which a fit finds every mode, one a row. `situation` is `{"layouts", "response",
     * "noise"}`. */
    int32_t (*starts)(void *plugin, LacunaText layout, LacunaText situation, const LacunaAnswer *answer);
    /* The derivatives of each output (rows) by each parameter (columns), for one response and its values. */
    /* May be null. */
    int32_t (*by_parameters)(void *plugin, LacunaText layout, LacunaNumbers response, LacunaNumbers values, double *jacobian, const LacunaAnswer *answer);
    /* The derivatives of one response along each row of `tangents`. */
    /* May be null. */
    int32_t (*push_forward)(void *plugin, LacunaText layout, LacunaNumbers response, LacunaNumbers values, LacunaNumbers tangents, double *changed, const LacunaAnswer *answer);
    /* Answers the versions of itself that a search for missing effects should try, a JSON list of options. */
    /* May be null. */
    int32_t (*proposals)(void *plugin, LacunaText situation, const LacunaAnswer *answer);
} LacunaEffectFunctions;

/* Reads files of one family of formats. Errors that are `REJECTED` may be the JSON object `{"path", "place",
 * "message", "help"}`. */
typedef struct LacunaReaderFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* 1 where it understands a file, judged by its first bytes (at most 4096) and its name. */
    int32_t (*recognises)(void *plugin, LacunaText path, LacunaText head);
    /* Answers what is in a file, as JSON: `{"format", "facts": [["…", "…"]], "variables": [{"name", "on", "axes",
     * "unit", "range", "not_finite", "columns": [{"name", "unit"}]}]}`, and for each variable a matrix with its
     * columns. */
    int32_t (*inspect)(void *plugin, LacunaText path, const LacunaAnswer *answer);
    /* 1 where the options name files of the user's own. */
    int32_t (*names_files)(void *plugin);
    /* Answers the files that the options name, a JSON list of paths; `source` is `{"directory", "scenario"}`. */
    int32_t (*files)(void *plugin, LacunaText source, const LacunaAnswer *answer);
    /* Answers simulation runs: a matrix of parameters and one of responses, one run a row, and the JSON object
     * `{"runs": ["…"], "valid": [true], "failed": [{"run", "reason"}]}`. `source` is `{"directory", "simulated",
     * "parameters", "scenario", "layout"}`. */
    /* May be null. */
    int32_t (*ensemble)(void *plugin, LacunaText source, const LacunaAnswer *answer);
    /* Answers measurements: a matrix `replicates x outputs` with NaN where nothing was measured, and the JSON list
     * of the replicates' names. `source` is `{"directory", "scenario", "layout"}`. Where the data state their
     * noise, the JSON is `{"replicates": ["…"], "sd": true, "covariance": true}` in the place of the list: with
     * `sd` a matrix of standard deviations follows (`replicates x outputs`, a row of NaN for a replicate that
     * states none, zero where nothing was measured), with `covariance` that of one complete measurement (`outputs x
     * outputs`). */
    /* May be null. */
    int32_t (*measurements)(void *plugin, LacunaText source, const LacunaAnswer *answer);
    /* Answers the numbers of an axis at which a scenario was measured: one row. `source` is `{"directory",
     * "scenario", "axis", "unit"}`. */
    /* May be null. */
    int32_t (*grid)(void *plugin, LacunaText source, const LacunaAnswer *answer);
    /* One response from one file. */
    /* May be null. */
    int32_t (*response)(void *plugin, LacunaText path, LacunaText layout, size_t outputs, double *values, const LacunaAnswer *answer);
    /* Writes the number of failures that so many simulation runs may have; `ABSENT` where the options do not say
     * it. Since version 1.1. */
    /* May be null. */
    int32_t (*allowed_failures)(void *plugin, size_t runs, size_t *allowed, const LacunaAnswer *answer);
} LacunaReaderFunctions;

/* The progress of a fit. */
typedef struct LacunaProgressFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* So many more units of work (outputs) are done. Any thread may call it. */
    void (*add)(void *progress, uint64_t units);
    /* Something a person should know. */
    void (*warn)(void *progress, LacunaText text);
} LacunaProgressFunctions;

/* Tells a person how far a fit came. */
typedef struct LacunaProgress {
    /* The size of this struct in bytes. */
    size_t size;
    /* The first argument of the functions. */
    void *progress;
    /* The functions. */
    const LacunaProgressFunctions *functions;
} LacunaProgress;

/* The runs to which a surrogate is fitted. */
typedef struct LacunaTraining {
    /* The size of this struct in bytes. */
    size_t size;
    /* Parameters and shapes of the responses, as JSON: `{"parameters", "layouts"}`. */
    LacunaText about;
    /* The parameters of each run in physical units, `runs x parameters`. */
    LacunaNumbers points;
    /* The responses, `runs x outputs`. */
    LacunaNumbers responses;
} LacunaTraining;

/* A fitted surrogate. Points are in physical units, one a row. */
typedef struct LacunaEmulatorFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Ends it. */
    void (*destroy)(void *emulator);
    /* The means, `points x outputs`. */
    int32_t (*mean)(void *emulator, LacunaNumbers points, double *values, const LacunaAnswer *answer);
    /* The derivative of each output (rows) by each parameter (columns) at one point. */
    int32_t (*jacobian)(void *emulator, LacunaNumbers point, double *jacobian, const LacunaAnswer *answer);
    /* Answers the leave-one-out error of each output relative to its variance, one row, and the leave-one-out
     * residuals, `runs x outputs`. */
    int32_t (*fit_error)(void *emulator, const LacunaAnswer *answer);
    /* Answers the emulator as bytes, for `load`. */
    int32_t (*save)(void *emulator, const LacunaAnswer *answer);
    /* The emulator's own variance, `points x outputs`; `ABSENT` where it knows none. */
    /* May be null. */
    int32_t (*variance)(void *emulator, LacunaNumbers points, double *values, const LacunaAnswer *answer);
    /* The emulator as a linear combination of basis functions, which lives as long as the emulator; `ABSENT` where
     * it is none. */
    /* May be null. */
    int32_t (*linear)(void *emulator, LacunaLinear *out, const LacunaAnswer *answer);
    /* Answers moments and Sobol' indices as JSON; `ABSENT` where the method does not know them exactly. */
    /* May be null. */
    int32_t (*sensitivity)(void *emulator, const LacunaAnswer *answer);
    /* Answers what is worth telling, a JSON list of `{"name", "value"}`. */
    /* May be null. */
    int32_t (*facts)(void *emulator, const LacunaAnswer *answer);
    /* The means at one point, and the derivatives of each output (rows) by `count` parameters (columns), given by
     * their numbers from zero; by all, in order, where `parameters` is null. What `mean` and `jacobian` answer,
     * where that costs less together. Since version 1.1. */
    /* May be null. */
    int32_t (*mean_and_jacobian)(void *emulator, LacunaNumbers point, const size_t *parameters, size_t count, double *mean, double *jacobian, const LacunaAnswer *answer);
} LacunaEmulatorFunctions;

/* A fitted surrogate. */
typedef struct LacunaEmulator {
    /* The size of this struct in bytes. */
    size_t size;
    /* The first argument of the functions. */
    void *emulator;
    /* The functions. */
    const LacunaEmulatorFunctions *functions;
    /* The number of parameters. */
    size_t dimension;
    /* The number of outputs. */
    size_t outputs;
} LacunaEmulator;

/* A part of a sum of emulators. */
typedef struct LacunaSummand {
    /* The bytes that `save` of an emulator answered. */
    LacunaText bytes;
    /* One weight an output. */
    LacunaNumbers weights;
} LacunaSummand;

/* Fits emulators to simulation runs. */
typedef struct LacunaSurrogateFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Fits an emulator to all outputs. */
    int32_t (*fit)(void *plugin, const LacunaTraining *training, LacunaKey key, const LacunaProgress *progress, LacunaEmulator *out, const LacunaAnswer *answer);
    /* An emulator from what `save` answered. */
    int32_t (*load)(void *plugin, LacunaText bytes, LacunaEmulator *out, const LacunaAnswer *answer);
    /* The sum of `count` emulators that this surrogate fitted, each output of each times its weight, plus an offset
     * for each output (one row), as one emulator of the same form: it is asked for the response and its sensitivity
     * only. `ABSENT` where the method has no such form, or these emulators do not go together. Since version 1.1. */
    /* May be null. */
    int32_t (*sum)(void *plugin, const LacunaSummand *parts, size_t count, LacunaNumbers offset, LacunaEmulator *out, const LacunaAnswer *answer);
} LacunaSurrogateFunctions;

/* A quantity that is ready to be computed. */
typedef struct LacunaFunctionalFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Ends it. */
    void (*destroy)(void *functional);
    /* Answers the unit of the value: a text as in a study, `1` for a number without unit. */
    int32_t (*unit)(void *functional, const LacunaAnswer *answer);
    /* The value for each row of `arguments`: the values of a curve, or named numbers; NaN where the quantity is
     * undefined. */
    int32_t (*value)(void *functional, LacunaNumbers arguments, double *values, const LacunaAnswer *answer);
} LacunaFunctionalFunctions;

/* A quantity as a function of certain arguments. */
typedef struct LacunaFunctional {
    /* The size of this struct in bytes. */
    size_t size;
    /* The first argument of the functions. */
    void *functional;
    /* The functions. */
    const LacunaFunctionalFunctions *functions;
} LacunaFunctional;

/* A number that follows from one curve of the response, or from named numbers of a study. Since version 1.2. */
typedef struct LacunaQuantityFunctions {
    /* The size of this table in bytes. */
    size_t size;
    /* Writes 1 for a quantity of a curve, 0 for one of named numbers. */
    int32_t (*of_curve)(void *plugin, uint8_t *of_curve, const LacunaAnswer *answer);
    /* The quantity as a function of arguments, which are described as JSON: `{"curve": {"name", "unit", "axis",
     * "grid", "grid_unit"}}` or `{"numbers": [{"name", "unit"}]}`. `REJECTED` with complaints as from `create`
     * where the options do not fit the arguments. */
    int32_t (*bind)(void *plugin, LacunaText arguments, LacunaFunctional *out, const LacunaAnswer *answer);
} LacunaQuantityFunctions;

/* The program that loads a library. */
typedef struct LacunaHost {
    /* The size of this struct in bytes. */
    size_t size;
    /* The version of the boundary. */
    uint32_t major;
    /* The minor version. */
    uint32_t minor;
    /* The number of threads that a library may use for work of its own. */
    size_t threads;
} LacunaHost;

/* One plugin of a library. */
typedef struct LacunaEntry {
    /* The size of this struct in bytes. */
    size_t size;
    /* The kind, such as `sampler`. */
    LacunaText kind;
    /* The name in a study. */
    LacunaText name;
    /* The functions that plugins of all kinds have. */
    const LacunaComponentFunctions *component;
    /* The functions of the kind: for a `sampler` a `SamplerFunctions`. */
    const void *functions;
} LacunaEntry;

/* The declaration of a library: the symbol `lacuna_plugin` that it exports. It is read before any of its code is
 * called. */
typedef struct LacunaDeclaration {
    /* `LACUNA_MAGIC`. */
    uint64_t magic;
    /* `LACUNA_MAJOR`. */
    uint32_t major;
    /* `LACUNA_MINOR`. */
    uint32_t minor;
    /* The size of this struct in bytes. */
    size_t size;
    /* 1 where an error cannot end the whole process (a panic unwinds), 0 where it would. */
    uint32_t unwinds;
    /* The number of entries. */
    uint32_t count;
    /* The name of the library. */
    LacunaText name;
    /* The version of the library. */
    LacunaText version;
    /* With what it was made, such as `lacuna-plugin 0.1.0`. */
    LacunaText sdk;
    /* The plugins. */
    const LacunaEntry *entries;
    /* The plain text by which `lacuna check` knows the library without loading it. */
    LacunaText record;
    /* Called once when the library is loaded, before anything else; may be null. */
    int32_t (*start)(const LacunaHost *host);
} LacunaDeclaration;

#define LACUNA_RECORD_BEGIN "lacuna-plugin-record:1.2\n"

/* A text from a string literal. */
#define LACUNA_TEXT(literal) { (const uint8_t *)(literal), sizeof(literal) - 1 }

/* One plugin of a library: a line of its record. */
#define LACUNA_PROVIDES(kind, name) kind "=" name "\n"

/* One plugin of a library: an element of its entries. */
#define LACUNA_ENTRY(kind, name, component, functions) \
    { sizeof(LacunaEntry), LACUNA_TEXT(kind), LACUNA_TEXT(name), &(component), &(functions) }

#if defined(_WIN32)
#define LACUNA_VISIBLE __declspec(dllexport)
#elif defined(__GNUC__)
#define LACUNA_VISIBLE __attribute__((visibility("default")))
#else
#define LACUNA_VISIBLE
#endif

#ifdef __cplusplus
#define LACUNA_EXPORT extern "C" LACUNA_VISIBLE
#else
#define LACUNA_EXPORT LACUNA_VISIBLE
#endif

/* The one symbol of a library: its name and version, a LACUNA_PROVIDES for each plugin, and an array of LacunaEntry. */
#define LACUNA_DECLARE(name, version, provides, entries) \
    LACUNA_EXPORT const LacunaDeclaration lacuna_plugin = { \
        LACUNA_MAGIC, LACUNA_MAJOR, LACUNA_MINOR, sizeof(LacunaDeclaration), 1u, \
        (uint32_t)(sizeof(entries) / sizeof((entries)[0])), LACUNA_TEXT(name), LACUNA_TEXT(version), \
        LACUNA_TEXT("lacuna_plugin.h"), (entries), LACUNA_TEXT(LACUNA_RECORD_BEGIN provides "end\n"), NULL \
    }

/* ---- reading JSON ----
 *
 * For options, layouts, sources and whatever else is passed as JSON, with any white space and any order of the keys.
 * The functions read nothing beyond a text, also where it is cut or no JSON; they do not complain of it. A value that is
 * not there is a text whose `bytes` are null. It can be passed on: every function says what it gives for it.
 */

/* The bytes of a text from one place to another. */
static inline LacunaText lacuna_json_part(LacunaText text, size_t from, size_t to)
{
    LacunaText part;
    part.bytes = from < to ? text.bytes + from : NULL;
    part.length = from < to ? to - from : 0;
    return part;
}

/* The next place of a text that has no white space; its length if there is none. */
static inline size_t lacuna_json_solid(LacunaText json, size_t at)
{
    while (at < json.length && memchr(" \t\n\r", json.bytes[at], 4) != NULL) {
        ++at;
    }
    return at;
}

/* The place behind the value that begins at a place; the same place if none begins there. */
static inline size_t lacuna_json_behind(LacunaText json, size_t at)
{
    size_t depth = 0;
    int quoted = 0;
    for (; at < json.length; ++at) {
        const uint8_t c = json.bytes[at];
        if (quoted) {
            at += c == '\\';
            quoted = c != '"';
            if (!quoted && depth == 0) {
                return at + 1;
            }
        } else if (c == '"') {
            quoted = 1;
        } else if (c == '{' || c == '[') {
            ++depth;
        } else if (c == '}' || c == ']') {
            if (depth < 2) {
                return at + depth;
            }
            --depth;
        } else if (depth == 0 && memchr(",: \t\n\r", c, 6) != NULL) {
            return at;
        }
    }
    return json.length;
}

/* The value of a text without the white space around it. */
static inline LacunaText lacuna_json_value(LacunaText json)
{
    const size_t from = lacuna_json_solid(json, 0);
    return lacuna_json_part(json, from, lacuna_json_behind(json, from));
}

/* Goes through the elements of a list or the entries of an object. */
typedef struct LacunaEach {
    /* The key of an entry, a JSON string; `bytes` are null for an element of a list. */
    LacunaText key;
    /* The value. */
    LacunaText value;
    /* The text from the bracket or comma before the next one. */
    LacunaText rest;
    /* The bracket at the end, `]` or `}`. */
    uint8_t end;
} LacunaEach;

/* The place before the first element of a list or entry of an object; of anything else there is none:
 *
 *     LacunaEach each = lacuna_json_each(list);
 *     while (lacuna_json_next(&each)) { … each.value … }
 */
static inline LacunaEach lacuna_json_each(LacunaText json)
{
    const LacunaText value = lacuna_json_value(json);
    const uint8_t first = value.length == 0 ? 0 : value.bytes[0];
    LacunaEach each;
    each.key = each.value = lacuna_json_part(json, 0, 0);
    each.rest = first == '[' || first == '{' ? value : each.value;
    each.end = first == '[' ? ']' : '}';
    return each;
}

/* Goes on to the next element or entry; 0 if there is none. */
static inline int lacuna_json_next(LacunaEach *each)
{
    const LacunaText rest = each->rest;
    size_t from = lacuna_json_solid(rest, rest.length == 0 ? 0 : 1), to = lacuna_json_behind(rest, from);
    each->key = each->value = each->rest = lacuna_json_part(rest, 0, 0);
    if (each->end == '}') {
        const size_t colon = lacuna_json_solid(rest, to);
        if (colon >= rest.length || rest.bytes[from] != '"' || rest.bytes[colon] != ':') {
            return 0;
        }
        each->key = lacuna_json_part(rest, from, to);
        from = lacuna_json_solid(rest, colon + 1);
        to = lacuna_json_behind(rest, from);
    }
    each->value = lacuna_json_part(rest, from, to);
    to = lacuna_json_solid(rest, to);
    /* What stands at the end of a text that was cut may be a part of a value only. */
    if (to >= rest.length || (rest.bytes[to] != ',' && rest.bytes[to] != each->end)) {
        each->value = lacuna_json_part(rest, 0, 0);
    }
    if (each->value.length > 0 && rest.bytes[to] == ',') {
        each->rest = lacuna_json_part(rest, to, rest.length);
    }
    return each->value.length > 0;
}

/* The number of elements of a list or of entries of an object; 0 of anything else. It reads all of them. */
static inline size_t lacuna_json_count(LacunaText json)
{
    LacunaEach each = lacuna_json_each(json);
    size_t count = 0;
    while (lacuna_json_next(&each)) {
        ++count;
    }
    return count;
}

/* The number that four hexadecimal digits stand for; above 0xffff if they are none. */
static inline uint32_t lacuna_json_hex(LacunaText json, size_t at)
{
    static const char digits[] = "0123456789abcdef0123456789ABCDEF";
    uint32_t number = 0;
    size_t i;
    for (i = 0; i < 4; ++i) {
        const void *digit = at + i < json.length ? memchr(digits, json.bytes[at + i], 32) : NULL;
        if (digit == NULL) {
            return UINT32_MAX;
        }
        number = 16 * number + (uint32_t)(((const char *)digit - digits) & 15);
    }
    return number;
}

/* The character at a place of a JSON string, as UTF-8, and its number of bytes; 0 at the end. The place goes behind
 * it. Half of a surrogate pair becomes U+FFFD. */
static inline size_t lacuna_json_character(LacunaText json, size_t *place, char *utf8)
{
    static const char letters[] = "btnfr", meanings[] = "\b\t\n\f\r";
    size_t at = *place, size = 0;
    const char *letter;
    uint32_t code, low;
    if (at >= json.length || json.bytes[at] == '"') {
        return 0;
    }
    if (json.bytes[at] != '\\') {
        /* A character of several bytes goes on with those from 0x80 to 0xbf. */
        do {
            utf8[size++] = (char)json.bytes[at++];
        } while (size < 4 && at < json.length && (json.bytes[at] & 0xc0) == 0x80);
        *place = at;
        return size;
    }
    if (++at >= json.length) {
        *place = at;
        return 0;
    }
    if (json.bytes[at] != 'u') {
        letter = (const char *)memchr(letters, json.bytes[at], 5);
        utf8[0] = letter == NULL ? (char)json.bytes[at] : meanings[letter - letters];
        *place = at + 1;
        return 1;
    }
    code = lacuna_json_hex(json, at + 1);
    at += code > 0xffff ? 1 : 5;
    low = code - 0xd800 < 0x400 && at + 1 < json.length && json.bytes[at] == '\\' && json.bytes[at + 1] == 'u'
              ? lacuna_json_hex(json, at + 2) - 0xdc00
              : UINT32_MAX;
    if (low < 0x400) {
        code = 0x10000 + ((code - 0xd800) << 10) + low;
        at += 6;
    } else if (code > 0xffff || code - 0xd800 < 0x800) {
        code = 0xfffd;
    }
    *place = at;
    if (code < 0x80) {
        utf8[0] = (char)code;
        return 1;
    }
    size = code < 0x800 ? 2 : code < 0x10000 ? 3 : 4;
    utf8[0] = (char)(((0xf00u >> size) & 0xf0u) | (code >> (6 * (size - 1))));
    for (at = 1; at < size; ++at) {
        utf8[at] = (char)(0x80u | ((code >> (6 * (size - 1 - at))) & 0x3fu));
    }
    return size;
}

/* 1 if a value is the string of so many bytes, else 0. */
static inline int lacuna_json_equals(LacunaText json, const char *text, size_t length)
{
    const LacunaText value = lacuna_json_value(json);
    size_t at = 1, size;
    char utf8[4];
    if (value.length < 2 || value.bytes[0] != '"') {
        return 0;
    }
    while ((size = lacuna_json_character(value, &at, utf8)) > 0) {
        if (size > length || memcmp(text, utf8, size) != 0) {
            return 0;
        }
        text += size;
        length -= size;
    }
    return length == 0 && at < value.length;
}

/* 1 if a value is this string, else 0: `lacuna_json_is(lacuna_json(layout, "unit"), "K")`. */
static inline int lacuna_json_is(LacunaText json, const char *text)
{
    return lacuna_json_equals(json, text, strlen(text));
}

/* The value at a path of keys and of numbers of elements from 0, with slashes between them, such as
 * "axes/0/coordinates/labels"; `bytes` are null if it is not there. The path "" is the whole value. Of keys that
 * are there twice the first counts; a key with a slash of its own is found by `lacuna_json_next`. */
static inline LacunaText lacuna_json(LacunaText json, const char *path)
{
    LacunaText value = lacuna_json_value(json);
    while (*path != '\0' && value.length > 0) {
        const size_t length = strcspn(path, "/");
        LacunaEach each = lacuna_json_each(value);
        size_t number = 0, i;
        /* Anything but digits is a number that no list has. */
        for (i = 0; i < length; ++i) {
            const size_t digit = (size_t)(path[i] - '0');
            number = digit > 9 || number > (SIZE_MAX - 9) / 10 ? SIZE_MAX : 10 * number + digit;
        }
        number = length == 0 ? SIZE_MAX : number;
        do {
            value = lacuna_json_next(&each) ? each.value : lacuna_json_part(json, 0, 0);
        } while (value.length > 0 && (each.end == '}' ? !lacuna_json_equals(each.key, path, length) : number-- != 0));
        path += length + (path[length] == '/');
    }
    return value;
}

/* Writes a string as UTF-8 with a zero at its end into a buffer of `size` bytes, or as many of its characters as
 * fit, and gives the number of its bytes without the zero: from `size` on it did not fit. SIZE_MAX, and an empty
 * text in the buffer, if the value is no string or not there. */
static inline size_t lacuna_json_string(LacunaText json, char *buffer, size_t size)
{
    const LacunaText value = lacuna_json_value(json);
    size_t at = 1, length = 0, end = 0, bytes;
    int fits = 1;
    char utf8[4];
    while (value.length > 1 && value.bytes[0] == '"' && (bytes = lacuna_json_character(value, &at, utf8)) > 0) {
        fits = fits && length + bytes < size;
        if (fits) {
            memcpy(buffer + length, utf8, bytes);
            end = length + bytes;
        }
        length += bytes;
    }
    if (value.length < 2 || value.bytes[0] != '"' || at >= value.length) {
        length = SIZE_MAX;
        end = 0;
    }
    if (size > 0) {
        buffer[end] = '\0';
    }
    return length;
}

/* 1 for true and 0 for false; `otherwise` if the value is `null` or not there, and -1 if it is anything else. */
static inline int lacuna_json_true(LacunaText json, int otherwise)
{
    const LacunaText value = lacuna_json_value(json);
    if (value.length == 0 || (value.length == 4 && memcmp(value.bytes, "null", 4) == 0)) {
        return otherwise;
    }
    if (value.length == 4 && memcmp(value.bytes, "true", 4) == 0) {
        return 1;
    }
    return value.length == 5 && memcmp(value.bytes, "false", 5) == 0 ? 0 : -1;
}

/* The double nearest to digits (behind a sign, if any) times a power of ten, which is written behind them into 8
 * bytes. There is no decimal point: `strtod` expects one of the language that the process has set. */
static inline double lacuna_decimal(char *digits, size_t length, int64_t power)
{
    size_t from = length + 2, to;
    uint64_t left;
    /* Far beyond what a double can be, with as many digits as are kept. */
    power = power > 99999 ? 99999 : power < -99999 ? -99999 : power;
    left = (uint64_t)(power < 0 ? -power : power);
    digits[length] = 'e';
    digits[length + 1] = power < 0 ? '-' : '+';
    for (to = from + 5; to-- > from; left /= 10) {
        digits[to] = (char)('0' + left % 10);
    }
    digits[from + 5] = '\0';
    return strtod(digits, NULL);
}

/* The double nearest to a number, or what {"float": "inf"}, "-inf" or "nan" stands for; `otherwise` if the value is
 * `null` or not there, and NaN if it is anything else. */
static inline double lacuna_json_number(LacunaText json, double otherwise)
{
    enum { lacuna_most_digits = 780 };
    const LacunaText value = lacuna_json_value(json), named = lacuna_json(value, "float");
    char digits[lacuna_most_digits + 32];
    size_t at = 0, size = 0, kept = 0, seen = 0;
    int64_t power = 0, written = 0;
    int fraction = 0, rest = 0, minus = 0;
    if (value.length == 0 || (value.length == 4 && memcmp(value.bytes, "null", 4) == 0)) {
        return otherwise;
    }
    if (named.length > 0) {
        return lacuna_json_is(named, "inf") ? INFINITY : lacuna_json_is(named, "-inf") ? -INFINITY : NAN;
    }
    if (value.bytes[0] == '-') {
        digits[size++] = '-';
        ++at;
    }
    for (; at < value.length; ++at) {
        const uint8_t c = value.bytes[at];
        if (c == '.' && !fraction && seen > 0) {
            fraction = 1;
            seen = 0;
        } else if (c < '0' || c > '9') {
            break;
        } else {
            ++seen;
            power += kept < lacuna_most_digits ? -fraction : !fraction;
            if (kept == lacuna_most_digits) {
                /* No double depends on more digits, except for whether any of them is other than zero. */
                rest = rest || c != '0';
            } else if (kept > 0 || c != '0') {
                digits[size++] = (char)c;
                ++kept;
            }
        }
    }
    if (rest) {
        digits[size++] = '1';
        --power;
    }
    if (kept == 0) {
        digits[size++] = '0';
    }
    if (seen > 0 && at < value.length && (value.bytes[at] == 'e' || value.bytes[at] == 'E')) {
        seen = 0;
        ++at;
        if (at < value.length && (value.bytes[at] == '-' || value.bytes[at] == '+')) {
            minus = value.bytes[at++] == '-';
        }
        for (; at < value.length && value.bytes[at] >= '0' && value.bytes[at] <= '9'; ++at, ++seen) {
            written = written > INT64_C(1000000000000000) ? written : 10 * written + (value.bytes[at] - '0');
        }
    }
    if (seen == 0 || at < value.length) {
        return NAN;
    }
    return lacuna_decimal(digits, size, power + (minus ? -written : written));
}

/* The numbers of a list as `lacuna_json_number` gives them, NaN for what is none, in memory that the caller frees;
 * NULL if there is none left. The count is 0 if the value is no list or not there. */
static inline double *lacuna_json_numbers(LacunaText json, size_t *count)
{
    LacunaEach each = lacuna_json_each(json);
    double *numbers;
    *count = lacuna_json_count(json);
    numbers = (double *)malloc((*count + 1) * sizeof *numbers);
    if (numbers != NULL) {
        size_t i = 0;
        while (lacuna_json_next(&each)) {
            numbers[i++] = lacuna_json_number(each.value, NAN);
        }
    }
    return numbers;
}

/* ---- answers ---- */

/* Appends a text to an answer. */
static inline void lacuna_say(const LacunaAnswer *answer, const char *bytes, size_t length)
{
    LacunaText text;
    text.bytes = (const uint8_t *)bytes;
    text.length = length;
    answer->text(answer->context, text);
}

/* Adds a matrix to an answer. */
static inline void lacuna_give(const LacunaAnswer *answer, const double *values, size_t rows, size_t columns)
{
    LacunaNumbers numbers;
    numbers.values = values;
    numbers.rows = rows;
    numbers.columns = columns;
    answer->numbers(answer->context, numbers);
}

/* Appends a text that ends with a zero, as it stands. Gives LACUNA_OK, for a function whose answer is one text. */
static inline int32_t lacuna_say_text(const LacunaAnswer *answer, const char *text)
{
    lacuna_say(answer, text, strlen(text));
    return LACUNA_OK;
}

/* Appends a value as it was passed, such as the unit of a layout; `null` if it is not there. */
static inline void lacuna_say_value(const LacunaAnswer *answer, LacunaText json)
{
    if (json.length == 0) {
        lacuna_say(answer, "null", 4);
    } else {
        answer->text(answer->context, json);
    }
}

/* The number of bytes of the character in UTF-8 at which a text goes on; 0 if it is none. */
static inline size_t lacuna_character(const char *text)
{
    const uint8_t *c = (const uint8_t *)text;
    const size_t size = c[0] < 0x80 ? 1 : c[0] < 0xc2 ? 0 : c[0] < 0xe0 ? 2 : c[0] < 0xf0 ? 3 : c[0] < 0xf5 ? 4 : 0;
    size_t i;
    for (i = 1; i < size; ++i) {
        if ((c[i] & 0xc0) != 0x80) {
            return 0;
        }
    }
    /* What fewer bytes could say, halves of surrogate pairs, and what is beyond the last character. */
    if ((c[0] == 0xe0 && c[1] < 0xa0) || (c[0] == 0xed && c[1] > 0x9f) || (c[0] == 0xf0 && c[1] < 0x90) ||
        (c[0] == 0xf4 && c[1] > 0x8f)) {
        return 0;
    }
    return size;
}

/* Appends a text that ends with a zero as a JSON string, in its quotes. A byte that is no UTF-8 becomes U+FFFD. */
static inline void lacuna_say_string(const LacunaAnswer *answer, const char *text)
{
    static const char digits[] = "0123456789abcdef";
    const char *from = text;
    lacuna_say(answer, "\"", 1);
    while (*text != '\0') {
        const size_t size = lacuna_character(text);
        const uint8_t c = (uint8_t)*text;
        char escape[6] = {'\\', 'u', '0', '0', '0', '0'};
        if (size > 0 && c >= 0x20 && c != '"' && c != '\\') {
            text += size;
            continue;
        }
        escape[4] = digits[c >> 4];
        escape[5] = digits[c & 15];
        lacuna_say(answer, from, (size_t)(text - from));
        lacuna_say(answer, size > 0 ? escape : "\\ufffd", 6);
        from = ++text;
    }
    lacuna_say(answer, from, (size_t)(text - from));
    lacuna_say(answer, "\"", 1);
}

/* Writes a whole number in digits, at most 20 and no zero behind them, and gives how many. */
static inline size_t lacuna_digits(char *digits, uint64_t number)
{
    size_t count = 1, i;
    uint64_t left;
    for (left = number; left > 9; left /= 10) {
        ++count;
    }
    for (i = count; i-- > 0; number /= 10) {
        digits[i] = (char)('0' + number % 10);
    }
    return count;
}

/* The least whole number whose product with a power of ten is read as `x` or more, or as more than `x`. */
static inline uint64_t lacuna_least(double x, int power, int more)
{
    uint64_t low = 0, high = UINT64_C(10000000000000000000);
    char digits[32];
    while (low < high) {
        const uint64_t middle = low + (high - low) / 2;
        const double read = lacuna_decimal(digits, lacuna_digits(digits, middle), power);
        if (more ? read > x : read >= x) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    return low;
}

/* The whole number of few digits whose product with a power of ten is read as `x`, which is above 0. No header but
 * <stdio.h> has a function that writes numbers, and that one writes them in the language of the process. */
static inline uint64_t lacuna_shortest(double x, int *power)
{
    uint64_t unit, number, middle;
    char digits[32];
    /* 18 digits are more than a double has, so that several numbers are read as this one. */
    *power = (int)floor(log10(x)) - 17;
    number = lacuna_least(x, *power, 0);
    number = middle = number + (lacuna_least(x, *power, 1) - 1 - number) / 2;
    for (unit = UINT64_C(1000000000000000000); unit > 1; unit /= 10) {
        const uint64_t tried = (middle + unit / 2) / unit * unit;
        if (lacuna_decimal(digits, lacuna_digits(digits, tried), *power) == x) {
            number = tried;
            break;
        }
    }
    for (; number % 10 == 0; number /= 10) {
        ++*power;
    }
    return number;
}

/* Appends a number with as few digits as are read as the same double, a whole one below 1e15 without point and
 * exponent. One that is not finite becomes {"float": "inf"}, "-inf" or "nan", as in options. */
static inline void lacuna_say_number(const LacunaAnswer *answer, double x)
{
    const double size = fabs(x);
    char digits[32], exponent[32] = "e-";
    int power = 0, point;
    size_t count;
    if (isnan(x) || isinf(x)) {
        lacuna_say_text(answer, "{\"float\":\"");
        lacuna_say_text(answer, isnan(x) ? "nan\"}" : x > 0.0 ? "inf\"}" : "-inf\"}");
        return;
    }
    if (signbit(x)) {
        lacuna_say(answer, "-", 1);
    }
    count = lacuna_digits(digits, size < 1e15 && floor(size) == size ? (uint64_t)size : lacuna_shortest(size, &power));
    point = (int)count + power;
    if (power < 0 && point > -4 && point <= 0) {
        lacuna_say(answer, "0.0000", (size_t)(2 - point));
        lacuna_say(answer, digits, count);
    } else if (power <= 0 && point > 0) {
        lacuna_say(answer, digits, (size_t)point);
        lacuna_say(answer, ".", power < 0);
        lacuna_say(answer, digits + point, count - (size_t)point);
    } else {
        const int minus = point < 1;
        lacuna_say(answer, digits, 1);
        lacuna_say(answer, ".", count > 1);
        lacuna_say(answer, digits + 1, count - 1);
        count = lacuna_digits(exponent + 1 + minus, (uint64_t)(minus ? 1 - point : point - 1));
        lacuna_say(answer, exponent, 1 + (size_t)minus + count);
    }
}

/* Says why there is no answer and gives the status: `return lacuna_fail(answer, LACUNA_REJECTED, "no such file");` */
static inline int32_t lacuna_fail(const LacunaAnswer *answer, int32_t status, const char *reason)
{
    lacuna_say_text(answer, reason);
    return status;
}

/* Says what was expected of an option and gives LACUNA_REJECTED: the answer of `create` to a wrong value. */
static inline int32_t lacuna_wrong_option(const LacunaAnswer *answer, const char *key, const char *expected)
{
    lacuna_say_text(answer, "[{\"at\":");
    lacuna_say_string(answer, key);
    lacuna_say_text(answer, ",\"message\":\"wrong value for `");
    lacuna_say_text(answer, key);
    lacuna_say_text(answer, "`\",\"expected\":");
    lacuna_say_string(answer, expected);
    return lacuna_fail(answer, LACUNA_REJECTED, "}]");
}

/* ---- random numbers ----
 *
 * All that a plugin draws must follow from the key of the call. The generator is xoshiro256++, each word of whose
 * state is the first number of SplitMix64 from a word of the key, so that keys that differ in a bit give sequences
 * that have nothing in common.
 *
 * References: Blackman and Vigna, ACM Trans. Math. Softw. 47 (2021) 36; Steele, Lea and Flood, Proc. OOPSLA (2014)
 * 453; https://prng.di.unimi.it.
 */

/* The state of the generator: for one thread. */
typedef struct LacunaRandom {
    /* The state of xoshiro256++; not all words are zero. */
    uint64_t words[4];
} LacunaRandom;

/* The next number of SplitMix64. */
static inline uint64_t lacuna_splitmix64(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

/* The generator at the beginning of the sequence of a key. */
static inline LacunaRandom lacuna_random(LacunaKey key)
{
    LacunaRandom random;
    size_t i;
    for (i = 0; i < 4; ++i) {
        random.words[i] = lacuna_splitmix64(&key.words[i]);
    }
    return random;
}

/* The next 64 bits. */
static inline uint64_t lacuna_bits(LacunaRandom *random)
{
    uint64_t *s = random->words;
    const uint64_t sum = s[0] + s[3], bits = ((sum << 23) | (sum >> 41)) + s[0], shifted = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= shifted;
    s[3] = (s[3] << 45) | (s[3] >> 19);
    return bits;
}

/* A number from the uniform distribution on [0, 1): a multiple of 2^-53. It can be 0, not 1. */
static inline double lacuna_uniform(LacunaRandom *random)
{
    return (double)(lacuna_bits(random) >> 11) / 9007199254740992.0;
}

/* A number from the standard normal distribution, by the method of Box and Muller from two uniform ones. */
static inline double lacuna_normal(LacunaRandom *random)
{
    const double radius = sqrt(-2.0 * log(1.0 - lacuna_uniform(random)));
    return radius * cos(6.283185307179586 * lacuna_uniform(random));
}

#ifdef __cplusplus
}
#endif

/* ---- C++17 ----
 *
 * What a library in C++ does at the boundary: nothing may unwind into the program, so every function of a table runs its
 * body in `lacuna::guard`.
 */
#if defined(__cplusplus) && __cplusplus >= 201703L

#include <exception>
#include <stdexcept>
#include <string>
#include <string_view>

namespace lacuna {

/* What the program may try again with something else. */
struct Rejected : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/* Appends to the text of an answer. */
inline int32_t say(const LacunaAnswer *answer, std::string_view text, int32_t status = LACUNA_OK)
{
    lacuna_say(answer, text.data(), text.size());
    return status;
}

/* Runs a function behind the boundary: an exception becomes the text of a status. */
template <class Act>
int32_t guard(const LacunaAnswer *answer, Act act) noexcept
{
    try {
        act();
        return LACUNA_OK;
    } catch (const Rejected &reason) {
        return say(answer, reason.what(), LACUNA_REJECTED);
    } catch (const std::exception &error) {
        return say(answer, error.what(), LACUNA_STOP);
    } catch (...) {
        return say(answer, "an exception of an unknown type", LACUNA_STOP);
    }
}

/* The complaint about the value of an option. */
inline Rejected wrong_option(const std::string &key, const std::string &expected)
{
    return Rejected("[{\"at\":\"" + key + "\",\"message\":\"wrong value for `" + key + "`\",\"expected\":\"" + expected +
                    "\"}]");
}

/* The bytes of a text as they stand. */
inline std::string string_of(LacunaText text)
{
    return text.length == 0 ? std::string() : std::string(reinterpret_cast<const char *>(text.bytes), text.length);
}

} // namespace lacuna

#endif

#endif

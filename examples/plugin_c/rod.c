/* A simulator in C: the temperature of a thin rod whose ends are kept in melting ice.
 *
 * Heat spreads along the rod and leaks through its insulation to surroundings that are as cold as the ends. With the
 * diffusivity a, the loss b and u the temperature above that of the ends,
 *
 *     du/dt = a d2u/dx2 - b u,    u(0, t) = u(L, t) = 0,    u(x, 0) = T sin(pi x / L) + T/2 sin(3 pi x / L)
 *
 * on cells of equal length, by explicit time steps. They are stable if 4 a dt / dx^2 + b dt <= 2; otherwise the simulator
 * rejects the run, as codes of this kind do. The exact solution is the sum of the two sines, the one with k half-waves
 * multiplied by exp(-(a (k pi / L)^2 + b) t).
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.141592653589793
#define MOST_STEPS 1e9

/* ---- the options ---- */

typedef struct {
    double length;  /* m */
    double height;  /* T, K */
    double step;    /* s */
    size_t cells;
} Rod;

static int32_t schema(const LacunaAnswer *answer)
{
    return lacuna_say_text(answer,
        "{\"type\":\"object\",\"description\":\"The temperature of a rod whose ends are kept in melting ice. The example of "
        "a simulator in C.\",\"additionalProperties\":false,\"properties\":{"
        "\"length\":{\"type\":\"number\",\"exclusiveMinimum\":0,\"default\":1.0,\"description\":\"The length in m.\"},"
        "\"height\":{\"type\":\"number\",\"exclusiveMinimum\":0,\"default\":80.0,\"description\":\"The temperature of the "
        "first half-wave at the beginning, in K above the ends.\"},"
        "\"step\":{\"type\":\"number\",\"exclusiveMinimum\":0,\"default\":1.0,\"description\":\"The longest step in s.\"},"
        "\"cells\":{\"type\":\"integer\",\"minimum\":4,\"maximum\":10000,\"default\":40,\"description\":\"The number of "
        "cells.\"}}}");
}

static int is_positive(double x)
{
    return x > 0.0 && !isinf(x);
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    const double length = lacuna_json_number(lacuna_json(options, "length"), 1.0);
    const double height = lacuna_json_number(lacuna_json(options, "height"), 80.0);
    const double step = lacuna_json_number(lacuna_json(options, "step"), 1.0);
    const double cells = lacuna_json_number(lacuna_json(options, "cells"), 40.0);
    Rod *rod;
    if (!is_positive(length) || !is_positive(height) || !is_positive(step)) {
        const char *wrong = !is_positive(length) ? "length" : !is_positive(height) ? "height" : "step";
        return lacuna_wrong_option(answer, wrong, "a number above 0");
    }
    if (!(cells >= 4.0 && cells <= 1e4) || floor(cells) != cells) {
        return lacuna_wrong_option(answer, "cells", "a whole number from 4 to 10000");
    }
    rod = malloc(sizeof *rod);
    if (rod == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    rod->length = length;
    rod->height = height;
    rod->step = step;
    rod->cells = (size_t)cells;
    *out = rod;
    return LACUNA_OK;
}

static int32_t options(void *plugin, const LacunaAnswer *answer)
{
    const Rod *rod = plugin;
    lacuna_say_text(answer, "{\"length\":");
    lacuna_say_number(answer, rod->length);
    lacuna_say_text(answer, ",\"height\":");
    lacuna_say_number(answer, rod->height);
    lacuna_say_text(answer, ",\"step\":");
    lacuna_say_number(answer, rod->step);
    lacuna_say_text(answer, ",\"cells\":");
    lacuna_say_number(answer, (double)rod->cells);
    return lacuna_say_text(answer, "}");
}

/* ---- positions and times ---- */

/* 1 if an axis has this name, and a grid in this unit. */
static int is_axis(LacunaText axis, const char *name, const char *unit)
{
    return lacuna_json_is(lacuna_json(axis, "name"), name) &&
           lacuna_json_is(lacuna_json(axis, "coordinates/grid/unit"), unit);
}

typedef struct {
    double *x, *t;
    size_t positions, times;
} Asked;

static void end_asked(Asked *asked)
{
    free(asked->x);
    free(asked->t);
}

/* The requested positions and, at each of them, increasing times; or the reason why the request is rejected. */
static const char *begin_asked(LacunaText layout, const Rod *rod, Asked *asked)
{
    const LacunaText axes = lacuna_json(layout, "axes");
    size_t i;
    if (!lacuna_json_is(lacuna_json(layout, "unit"), "K")) {
        return "expected a response in K";
    }
    if (lacuna_json_count(axes) != 2 || !is_axis(lacuna_json(axes, "0"), "position", "m") ||
        !is_axis(lacuna_json(axes, "1"), "time", "s")) {
        return "expected the axes `position` in m and `time` in s, in this order";
    }
    asked->x = lacuna_json_numbers(lacuna_json(axes, "0/coordinates/grid/values"), &asked->positions);
    asked->t = lacuna_json_numbers(lacuna_json(axes, "1/coordinates/grid/values"), &asked->times);
    if (asked->x == NULL || asked->t == NULL) {
        return "there is no memory left";
    }
    for (i = 0; i < asked->positions; ++i) {
        if (!(asked->x[i] >= 0.0 && asked->x[i] <= rod->length)) {
            return "expected positions on the rod";
        }
    }
    for (i = 0; i < asked->times; ++i) {
        if (!(asked->t[i] >= (i == 0 ? 0.0 : asked->t[i - 1]) && asked->t[i] <= MOST_STEPS * rod->step)) {
            return "expected times that go up from 0, of at most 1e9 steps";
        }
    }
    return NULL;
}

static int32_t check(void *plugin, LacunaText context, const LacunaAnswer *answer)
{
    Asked asked = {NULL, NULL, 0, 0};
    const char *reason = begin_asked(lacuna_json(context, "layout"), plugin, &asked);
    end_asked(&asked);
    if (reason == NULL) {
        return LACUNA_OK;
    }
    lacuna_say_text(answer, "[{\"message\":\"the rod cannot give this response: ");
    lacuna_say_text(answer, reason);
    return lacuna_say_text(answer, "\"}]");
}

/* ---- the simulation ---- */

static int32_t signature(void *plugin, LacunaText context, const LacunaAnswer *answer)
{
    (void)plugin;
    (void)context;
    return lacuna_say_text(answer,
        "{\"inputs\":[{\"name\":\"diffusivity\",\"unit\":\"m2/s\",\"default\":1.1e-4,\"low\":0,\"high\":null,"
        "\"description\":\"how fast heat spreads along the rod\"},"
        "{\"name\":\"loss\",\"unit\":\"1/s\",\"default\":1e-3,\"low\":0,\"high\":null,"
        "\"description\":\"how fast heat leaks out of it\"}],\"resamples\":true}");
}

/* Advances by a time in steps of equal length, none longer than the option allows. */
static void go_on(const Rod *rod, double a, double b, double time, double *u, double *next)
{
    const double dx = rod->length / (double)rod->cells;
    const size_t steps = (size_t)ceil(time / rod->step);
    const double dt = steps == 0 ? 0.0 : time / (double)steps;
    size_t step, i;
    for (step = 0; step < steps; ++step) {
        for (i = 1; i < rod->cells; ++i) {
            next[i] = u[i] + dt * (a * (u[i - 1] - 2.0 * u[i] + u[i + 1]) / (dx * dx) - b * u[i]);
        }
        memcpy(u + 1, next + 1, (rod->cells - 1) * sizeof *u);
    }
}

/* One run; `u` and `next` have one entry per end of a cell. The response is ordered by position, then by time. */
static void simulate(const Rod *rod, const Asked *asked, double a, double b, double *u, double *next, double *response)
{
    double now = 0.0;
    size_t i, k;
    for (i = 0; i <= rod->cells; ++i) {
        const double x = PI * (double)i / (double)rod->cells;
        u[i] = rod->height * (sin(x) + 0.5 * sin(3.0 * x));
    }
    u[0] = u[rod->cells] = 0.0;
    for (k = 0; k < asked->times; ++k) {
        go_on(rod, a, b, asked->t[k] - now, u, next);
        now = asked->t[k];
        for (i = 0; i < asked->positions; ++i) {
            const double place = asked->x[i] / rod->length * (double)rod->cells;
            const size_t left = place < (double)rod->cells ? (size_t)place : rod->cells - 1;
            const double share = place - (double)left;
            response[i * asked->times + k] = (1.0 - share) * u[left] + share * u[left + 1];
        }
    }
}

/* The reason why these inputs are rejected; empty if they are accepted. */
static void refusal(const Rod *rod, double a, double b, char *reason, size_t size)
{
    const double dx = rod->length / (double)rod->cells;
    reason[0] = '\0';
    if (!(a >= 0.0 && b >= 0.0) || isinf(a) || isinf(b)) {
        snprintf(reason, size, "expected a diffusivity and a loss of 0 or more, found %g and %g", a, b);
    } else if ((4.0 * a / (dx * dx) + b) * rod->step > 2.0) {
        snprintf(reason, size, "steps of %g s are not stable at a diffusivity of %g m2/s and a loss of %g 1/s, on cells of %g m",
                 rod->step, a, b, dx);
    }
}

/* All runs of a batch; the messages are a list with `null` for each successful run. */
static int32_t predict(void *plugin, const LacunaCalls *calls, double *responses, int32_t *statuses, uint8_t *valid,
                       const LacunaAnswer *answer)
{
    const Rod *rod = plugin;
    Asked asked = {NULL, NULL, 0, 0};
    double *u = malloc((rod->cells + 1) * sizeof *u), *next = malloc((rod->cells + 1) * sizeof *next);
    const char *wrong = u == NULL || next == NULL ? "there is no memory left"
                                                  : begin_asked(lacuna_json(calls->about, "layout"), rod, &asked);
    int32_t status = LACUNA_OK;
    size_t i;
    if (wrong == NULL && calls->inputs.columns != 2) {
        wrong = "expected two inputs, the diffusivity and the loss";
    }
    if (wrong != NULL) {
        status = lacuna_fail(answer, LACUNA_FATAL, wrong);
    }
    for (i = 0; wrong == NULL && i < calls->inputs.rows; ++i) {
        const double *input = calls->inputs.values + 2 * i;
        char reason[200];
        refusal(rod, input[0], input[1], reason, sizeof reason);
        valid[i] = 1;
        statuses[i] = reason[0] == '\0' ? LACUNA_OK : LACUNA_REJECTED;
        lacuna_say_text(answer, i == 0 ? "[" : ",");
        if (statuses[i] == LACUNA_OK) {
            simulate(rod, &asked, input[0], input[1], u, next, responses + i * asked.positions * asked.times);
            lacuna_say_text(answer, "null");
        } else {
            lacuna_say_text(answer, "{\"message\":");
            lacuna_say_string(answer, reason);
            lacuna_say_text(answer, "}");
        }
    }
    if (wrong == NULL && calls->inputs.rows > 0) {
        lacuna_say_text(answer, "]");
    }
    end_asked(&asked);
    free(u);
    free(next);
    return status;
}

/* Texts are parsed once per batch, not once per run. */
static size_t batch(void *plugin)
{
    (void)plugin;
    return 16;
}

/* ---- the library ---- */

static const LacunaComponentFunctions component = {
    .size = sizeof(LacunaComponentFunctions), .schema = schema, .create = create, .destroy = free, .options = options,
    .check = check
};

static const LacunaModelFunctions model = {
    .size = sizeof(LacunaModelFunctions), .signature = signature, .predict = predict, .batch = batch
};

static const LacunaEntry entries[] = {
    LACUNA_ENTRY("model", "rod", component, model)
};

LACUNA_DECLARE("rod", "1.0.0", LACUNA_PROVIDES("model", "rod"), entries);

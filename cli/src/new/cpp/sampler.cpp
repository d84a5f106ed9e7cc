/* `skeleton`: random-walk Metropolis with step sizes from the prior.
 *
 * Each chain proposes a normal step of fixed width and accepts it with the ratio of the densities, or stays: exact from
 * the first step, without adaptation.
 *
 * Reference: Metropolis, Rosenbluth, Rosenbluth, Teller and Teller, J. Chem. Phys. 21 (1953) 1087.
 */
#include "lacuna_plugin.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

using lacuna::guard;
using lacuna::say;
using lacuna::wrong_option;

/* ---- the options ---- */

struct Plugin {
    size_t chains = 4, steps = 10000;
    double width = 0.5;

    explicit Plugin(LacunaText options)
    {
        chains = whole(options, "chains", 2, chains);
        steps = whole(options, "steps", 1, steps);
        width = lacuna_json_number(lacuna_json(options, "width"), width);
        if (!(width > 0.0 && std::isfinite(width))) {
            throw wrong_option("width", "a number above 0");
        }
    }

private:
    static size_t whole(LacunaText options, const char *key, size_t least, size_t usual)
    {
        const double found = lacuna_json_number(lacuna_json(options, key), static_cast<double>(usual));
        if (!(found >= static_cast<double>(least) && found <= 1e15 && std::floor(found) == found)) {
            throw wrong_option(key, "a whole number from " + std::to_string(least));
        }
        return static_cast<size_t>(found);
    }
};

int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, R"({
    "type": "object",
    "description": "Random-walk Metropolis: each chain proposes a normal step of fixed width and accepts it )"
    R"(with the ratio of the densities, or stays.",
    "additionalProperties": false,
    "properties": {
        "chains": {
            "type": "integer", "minimum": 2, "default": 4,
            "description": "Number of independent chains."
        },
        "steps": {
            "type": "integer", "minimum": 1, "default": 10000,
            "description": "Number of steps of each chain."
        },
        "width": {
            "type": "number", "exclusiveMinimum": 0, "default": 0.5,
            "description": "Standard deviation of a proposal in each unknown, as a fraction of that of its prior."
        }
    }
})");
}

int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    return guard(answer, [&] { *out = new Plugin(options); });
}

void destroy(void *plugin)
{
    delete static_cast<Plugin *>(plugin);
}

/* All options with their defaults, which the record of a run keeps. */
int32_t options(void *plugin, const LacunaAnswer *answer)
{
    const auto &p = *static_cast<const Plugin *>(plugin);
    lacuna_say_text(answer, R"({"chains":)");
    lacuna_say_number(answer, static_cast<double>(p.chains));
    lacuna_say_text(answer, R"(,"steps":)");
    lacuna_say_number(answer, static_cast<double>(p.steps));
    lacuna_say_text(answer, R"(,"width":)");
    lacuna_say_number(answer, p.width);
    return lacuna_say_text(answer, "}");
}

/* ---- the sampler ---- */

int32_t plan(void *plugin, size_t, LacunaPlan *out, const LacunaAnswer *)
{
    const auto &p = *static_cast<const Plugin *>(plugin);
    *out = {p.chains, p.steps, 0, 0};
    return LACUNA_OK;
}

/* The text of the answer has the program's reason already when it does not answer. */
void demand(int32_t status)
{
    if (status != LACUNA_OK) {
        throw std::runtime_error("");
    }
}

std::vector<double> log_density(const LacunaTarget &target, const double *points, size_t rows,
                                const LacunaAnswer *answer)
{
    std::vector<double> values(rows);
    demand(target.functions->log_density(target.target, {points, rows, target.dimension}, values.data(), answer));
    return values;
}

/* Half the distance between the 16 % and 84 % quantiles of the prior of each unknown. */
std::vector<double> widths(const LacunaTarget &target, const LacunaAnswer *answer)
{
    constexpr size_t count = 1000;
    /* Any fixed key serves: the draws only give a width. */
    const LacunaKey key{{1, 2, 3, 4}};
    std::vector<double> draws(count * target.dimension), column(count), found;
    demand(target.functions->prior_draws(target.target, count, key, draws.data(), answer));
    for (size_t j = 0; j < target.dimension; ++j) {
        for (size_t i = 0; i < count; ++i) {
            column[i] = draws[i * target.dimension + j];
        }
        std::sort(column.begin(), column.end());
        found.push_back(0.5 * (column[840] - column[160]));
    }
    return found;
}

/* The memory of a run is a JSON list of the widths. */
void write(const std::vector<double> &widths, const LacunaAnswer *answer)
{
    for (size_t j = 0; j < widths.size(); ++j) {
        say(answer, j == 0 ? "[" : ",");
        lacuna_say_number(answer, widths[j]);
    }
    say(answer, widths.empty() ? "[]" : "]");
}

std::vector<double> read(LacunaText memory)
{
    std::vector<double> widths;
    for (LacunaEach each = lacuna_json_each(memory); lacuna_json_next(&each) != 0;) {
        widths.push_back(lacuna_json_number(each.value, 0.0));
    }
    return widths;
}

int32_t start(void *plugin, const LacunaTarget *target, LacunaState *state, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const size_t chains = static_cast<const Plugin *>(plugin)->chains;
        if (state->chains != chains || state->dimension != target->dimension) {
            throw std::runtime_error("expected " + std::to_string(chains) + " starting points, found " +
                                     std::to_string(state->chains));
        }
        const auto density = log_density(*target, state->points, chains, answer);
        if (!std::all_of(density.begin(), density.end(), [](double d) { return std::isfinite(d); })) {
            throw std::runtime_error("a chain starts where the density is zero");
        }
        std::copy(density.begin(), density.end(), state->log_density);
        std::fill_n(state->accepted, chains, uint8_t{0});
        state->evaluations = chains;
        write(widths(*target, answer), answer);
    });
}

/* All that is drawn follows from the key of the call alone. */
int32_t step(void *plugin, const LacunaTarget *target, LacunaState *state, LacunaKey key, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const double width = static_cast<const Plugin *>(plugin)->width;
        const size_t chains = state->chains, dimension = state->dimension;
        const auto widths = read(state->memory);
        LacunaRandom random = lacuna_random(key);
        std::vector<double> tried(state->points, state->points + chains * dimension);
        for (size_t at = 0; at < tried.size(); ++at) {
            tried[at] += width * widths.at(at % dimension) * lacuna_normal(&random);
        }
        const auto density = log_density(*target, tried.data(), chains, answer);
        state->evaluations += chains;
        for (size_t i = 0; i < chains; ++i) {
            state->accepted[i] = std::log(lacuna_uniform(&random)) < density[i] - state->log_density[i];
            if (state->accepted[i] != 0) {
                std::copy_n(&tried[i * dimension], dimension, state->points + i * dimension);
                state->log_density[i] = density[i];
            }
        }
    });
}

/* A run may end after any number of steps. */
int32_t steps_are_draws(void *, uint8_t *draws, const LacunaAnswer *)
{
    *draws = 1;
    return LACUNA_OK;
}

/* ---- the library ---- */

constexpr LacunaComponentFunctions component = [] {
    LacunaComponentFunctions table{};
    table.size = sizeof table;
    table.schema = schema;
    table.create = create;
    table.destroy = destroy;
    table.options = options;
    return table;
}();

constexpr LacunaSamplerFunctions sampler = [] {
    LacunaSamplerFunctions table{};
    table.size = sizeof table;
    table.plan = plan;
    table.start = start;
    table.step = step;
    table.steps_are_draws = steps_are_draws;
    return table;
}();

const LacunaEntry entries[] = {LACUNA_ENTRY("sampler", "skeleton", component, sampler)};

} // namespace

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("sampler", "skeleton"), entries);

/* A skeleton, which is linked beside, with JSON of other order and spacing than the program writes. */
#include "lacuna_plugin.h"

#include <stdio.h>

#ifdef __cplusplus
extern "C" const LacunaDeclaration lacuna_plugin;
#else
extern const LacunaDeclaration lacuna_plugin;
#endif

#define LAYOUT \
    "{ \"axes\" : [ { \"coordinates\":{\"grid\": {\"unit\" : \"s\", \"values\":[ 0.0 ,\n1, 2e0 ]}},\"name\":\"ti\\u006de\" } ],\n" \
    "\"unit\" :\"m\\/s\" , \"name\": \"unit\"}"

/* Options of a kind, with their default values in another spelling, and what is answered as all options. */
static const char *const options[][3] = {
    {"design", " { \"random_start\" :\ntrue } ", "{\"random_start\":true}"},
    {"discrepancy", "{\"scale\": 25e-2}", NULL},
    {"effect", "{\t\"deviation\" : 1.0E-1 }", "{\"deviation\":0.1}"},
    {"model", "{ \"background\" :25e-2 }", "{\"background\":0.25}"},
    {"quantity", "{ \"about_mean\" : false }", "{\"about_mean\":false}"},
    {"reader", "{ \"path\" : \"d\\u00e4ta.csv\" }", NULL},
    {"sampler", "{\"width\" :5e-1 , \"steps\": 1e2, \"chains\" : 4}", "{\"chains\":4,\"steps\":100,\"width\":0.5}"},
    {"surrogate", "{ \"length\" : 1.0 }", NULL},
};

static char said[4096];
static size_t length_said = 0;

static void take_text(void *context, LacunaText text)
{
    (void)context;
    if (text.length < sizeof said - length_said) {
        memcpy(said + length_said, text.bytes, text.length);
        length_said += text.length;
    }
    said[length_said] = '\0';
}

static void take_numbers(void *context, LacunaNumbers numbers)
{
    (void)context;
    (void)numbers;
}

static LacunaText text_of(const char *text)
{
    LacunaText json;
    json.bytes = (const uint8_t *)text;
    json.length = strlen(text);
    return json;
}

static int fails(const char *what)
{
    printf("%s: %s\n", what, said);
    return 1;
}

/* Two runs at three times in the unit of the response. */
static int model_fails(const LacunaModelFunctions *model, void *plugin, const LacunaAnswer *answer)
{
    static const double inputs[4] = {2.0, 0.0, 1.0, 1.0};
    double responses[6];
    int32_t statuses[2];
    uint8_t valid[2];
    LacunaCalls calls;
    memset(&calls, 0, sizeof calls);
    calls.size = sizeof calls;
    calls.inputs.values = inputs;
    calls.inputs.rows = calls.inputs.columns = 2;
    calls.about = text_of("{\"names\":[\"layout\"], \"layout\" : " LAYOUT "}");
    length_said = 0;
    if (model->signature(plugin, calls.about, answer) != LACUNA_OK ||
        !lacuna_json_is(lacuna_json(text_of(said), "inputs/0/unit"), "m/s")) {
        return fails("signature");
    }
    return (model->predict(plugin, &calls, responses, statuses, valid, answer) != LACUNA_OK || responses[0] != 2.25 ||
            responses[5] != exp(-2.0) + 0.25) && fails("predict");
}

static int effect_fails(const LacunaEffectFunctions *effect, void *plugin, const LacunaAnswer *answer)
{
    static const double response[3] = {1.0, 1.0, 1.0}, slope = 0.5;
    LacunaNumbers responses, values;
    double changed[3];
    responses.values = response;
    responses.rows = 1;
    responses.columns = 3;
    values.values = &slope;
    values.rows = values.columns = 1;
    return (effect->apply(plugin, text_of(LAYOUT), responses, values, changed, answer) != LACUNA_OK ||
            changed[0] != 0.5 || changed[1] != 1.0 || changed[2] != 1.5) && fails("apply");
}

static int quantity_fails(const LacunaQuantityFunctions *quantity, void *plugin, const LacunaAnswer *answer)
{
    LacunaFunctional functional;
    if (quantity->bind(plugin, text_of("{\"curve\":{\"grid\" : [ 3 , 4 ] }}"), &functional, answer) != LACUNA_OK) {
        return fails("bind");
    }
    functional.functions->destroy(functional.functional);
    return quantity->bind(plugin, text_of("{\"curve\":{\"grid\" : [ 3 ], \"unit\":\",\" }}"), &functional, answer) !=
               LACUNA_REJECTED && fails("bind of one point");
}

static int reader_fails(const LacunaReaderFunctions *reader, void *plugin, const LacunaAnswer *answer)
{
    length_said = 0;
    return (reader->files(plugin, text_of("{\"scenario\":null, \"directory\" : \"a\\\\b\\\"c\"}"), answer) != LACUNA_OK ||
            !lacuna_json_is(lacuna_json(text_of(said), "0"), "a\\b\"c/d\xc3\xa4ta.csv")) && fails("files");
}

int main(void)
{
    const LacunaEntry *entry = lacuna_plugin.entries;
    LacunaAnswer answer;
    void *plugin = NULL;
    int failures = 0;
    size_t i = 0;
    answer.size = sizeof answer;
    answer.context = NULL;
    answer.text = take_text;
    answer.numbers = take_numbers;
    while (strlen(options[i][0]) != entry->kind.length || memcmp(options[i][0], entry->kind.bytes, entry->kind.length) != 0) {
        ++i;
    }
    if (entry->component->create(text_of(options[i][1]), &plugin, &answer) != LACUNA_OK) {
        return fails("create");
    }
    if (options[i][2] != NULL) {
        entry->component->options(plugin, &answer);
        failures += strcmp(said, options[i][2]) != 0 && fails("options");
    }
    switch (options[i][0][0]) {
    case 'e':
        failures += effect_fails((const LacunaEffectFunctions *)entry->functions, plugin, &answer);
        break;
    case 'm':
        failures += model_fails((const LacunaModelFunctions *)entry->functions, plugin, &answer);
        break;
    case 'q':
        failures += quantity_fails((const LacunaQuantityFunctions *)entry->functions, plugin, &answer);
        break;
    case 'r':
        failures += reader_fails((const LacunaReaderFunctions *)entry->functions, plugin, &answer);
        break;
    default:
        break;
    }
    entry->component->destroy(plugin);
    printf("%d failures\n", failures);
    return failures > 0;
}

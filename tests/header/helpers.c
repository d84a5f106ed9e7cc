/* The functions of `lacuna_plugin.h` against lists of cases. Every text is in a block of its own, of exactly its length, so
 * that a sanitizer of addresses sees a byte that is read beyond it.
 */
#include "lacuna_plugin.h"

#include <inttypes.h>
#include <locale.h>
#include <stdio.h>

#define COUNT(list) (sizeof(list) / sizeof((list)[0]))

static int failures = 0;

static void expect(int holds, const char *what, const char *of)
{
    if (!holds) {
        ++failures;
        printf("%s: %s\n", what, of);
    }
}

/* The first bytes of a text in a block of their own, to be freed. */
static uint8_t *begin(const char *text, size_t length, LacunaText *out)
{
    uint8_t *block = (uint8_t *)malloc(length == 0 ? 1 : length);
    if (block == NULL) {
        abort();
    }
    memcpy(block, text, length);
    out->bytes = length == 0 ? NULL : block;
    out->length = length;
    return block;
}

/* ---- reading ---- */

static const char *const spaced =
    " \t{\r\n \"unit\" : \"m\\/s\", \"axes\":[ {\"coordinates\" :{ \"labels\" : [ \"B\" , \"C\",\"a \\\"b\\\" ]\" ] },\"name\":"
    "\"sensor\"}\n, {\"name\":\"time\",\"coordinates\":{\"grid\":{\"unit\":\"s\",\"values\":[0.0,1e-3 , -2.5E+1,3]}}} ],"
    "\"\\u0061\\ud83d\\ude00\":[[],{},[[1],[2,3]],null,true,false],\"\":{\"x\":7},\"unit\":\"twice\",\"10\":\"ten\" } ";

/* A document, a path, and the bytes of the value there; NULL if there is none. */
static const char *const paths[][3] = {
    {"spaced", "unit", "\"m\\/s\""},
    {"spaced", "axes/0/name", "\"sensor\""},
    {"spaced", "axes/1/name", "\"time\""},
    {"spaced", "axes/0/coordinates/labels/1", "\"C\""},
    {"spaced", "axes/0/coordinates/labels/2", "\"a \\\"b\\\" ]\""},
    {"spaced", "axes/0/coordinates/labels/3", NULL},
    {"spaced", "axes/1/coordinates/grid/values", "[0.0,1e-3 , -2.5E+1,3]"},
    {"spaced", "axes/1/coordinates/grid/values/2", "-2.5E+1"},
    {"spaced", "axes/1/coordinates/grid/unit", "\"s\""},
    {"spaced", "axes/2", NULL},
    {"spaced", "axes/-1", NULL},
    {"spaced", "axes/x", NULL},
    {"spaced", "axes/99999999999999999999999999", NULL},
    {"spaced", "a\xf0\x9f\x98\x80/2/1/1", "3"},
    {"spaced", "a\xf0\x9f\x98\x80/0", "[]"},
    {"spaced", "a\xf0\x9f\x98\x80/0/0", NULL},
    {"spaced", "a\xf0\x9f\x98\x80/1/0", NULL},
    {"spaced", "a\xf0\x9f\x98\x80/3", "null"},
    {"spaced", "a\xf0\x9f\x98\x80/5", "false"},
    {"spaced", "/x", "7"},
    {"spaced", "10", "\"ten\""},
    {"spaced", "1", NULL},
    {"spaced", "unit/0", NULL},
    {"spaced", "name", NULL},
    {" 12 ", "", "12"},
    {"12", "0", NULL},
    {"[1]", "0", "1"},
    {"[ ]", "0", NULL},
    {"{ }", "a", NULL},
    {"{\"a\":{\"b\":1},\"b\":2}", "b", "2"},
    {"{\"a\":\"\\\\\",\"b\":\"\\\"}\"}", "b", "\"\\\"}\""},
    {"", "", NULL},
    {"  ", "a", NULL},
    /* What was cut gives what is whole. */
    {"[12,34", "0", "12"},
    {"[12,34", "1", NULL},
    {"{\"a\":1,\"b\":2", "a", "1"},
    {"{\"a\":1,\"b\":2", "b", NULL},
    {"{\"a\"", "a", NULL},
};

static void test_paths(void)
{
    size_t i;
    for (i = 0; i < COUNT(paths); ++i) {
        const char *document = strcmp(paths[i][0], "spaced") == 0 ? spaced : paths[i][0], *wanted = paths[i][2];
        LacunaText json, found;
        uint8_t *block = begin(document, strlen(document), &json);
        found = lacuna_json(json, paths[i][1]);
        expect(wanted == NULL ? found.bytes == NULL && found.length == 0
                              : found.length == strlen(wanted) && memcmp(found.bytes, wanted, found.length) == 0,
               "path", paths[i][1]);
        free(block);
    }
}

static void test_elements(void)
{
    static const size_t counts[] = {3, 0, 0, 2, 0, 1};
    static const char *const lists[] = {"[1, [2,3] ,{}]", "[ ]", " {\n}", "{\"a\":[1,2],\"b\":\"]\"}", "3", "[\"a,b\"]"};
    LacunaText json;
    LacunaEach each;
    uint8_t *block;
    size_t i;
    for (i = 0; i < COUNT(lists); ++i) {
        block = begin(lists[i], strlen(lists[i]), &json);
        expect(lacuna_json_count(json) == counts[i], "count", lists[i]);
        free(block);
    }
    block = begin(lists[3], strlen(lists[3]), &json);
    each = lacuna_json_each(json);
    expect(lacuna_json_next(&each) && lacuna_json_is(each.key, "a") && lacuna_json_count(each.value) == 2, "each", "a");
    expect(lacuna_json_next(&each) && lacuna_json_is(each.key, "b") && lacuna_json_is(each.value, "]"), "each", "b");
    expect(!lacuna_json_next(&each) && !lacuna_json_next(&each) && each.value.bytes == NULL, "each", "end");
    free(block);
}

/* A JSON string, and what it stands for; NULL if it is none. */
static const char *const strings[][2] = {
    {"\"\"", ""},
    {" \"abc\" ", "abc"},
    {"\"\\\"\\\\\\/\\b\\f\\n\\r\\t\"", "\"\\/\b\f\n\r\t"},
    {"\"\\u0041\\u00e9\\u20AC\\uD834\\uDD1E\"", "A\xc3\xa9\xe2\x82\xac\xf0\x9d\x84\x9e"},
    {"\"\xc3\xa9\xe2\x82\xac\xf0\x9d\x84\x9e\"", "\xc3\xa9\xe2\x82\xac\xf0\x9d\x84\x9e"},
    {"\"\\ud834\"", "\xef\xbf\xbd"},
    {"\"\\ud834x\"", "\xef\xbf\xbdx"},
    {"\"\\udd1e\\ud834\\u0041\"", "\xef\xbf\xbd\xef\xbf\xbd" "A"},
    {"\"\\uffff\\u07ff\\u0800\"", "\xef\xbf\xbf\xdf\xbf\xe0\xa0\x80"},
    {"\"\\udbff\\udfff\"", "\xf4\x8f\xbf\xbf"},
    {"\"abc", NULL},
    {"\"abc\\", NULL},
    {"\"abc\\\"", NULL},
    {"\"", NULL},
    {"3", NULL},
    {"null", NULL},
    {"[\"a\"]", NULL},
    {"", NULL},
};

static void test_strings(void)
{
    size_t i, size;
    for (i = 0; i < COUNT(strings); ++i) {
        const char *wanted = strings[i][1];
        const size_t length = wanted == NULL ? SIZE_MAX : strlen(wanted);
        LacunaText json;
        uint8_t *block = begin(strings[i][0], strlen(strings[i][0]), &json);
        expect(lacuna_json_string(json, NULL, 0) == length, "length of string", strings[i][0]);
        for (size = 1; size < 24; ++size) {
            char *buffer = (char *)malloc(size);
            const size_t found = buffer == NULL ? 0 : lacuna_json_string(json, buffer, size);
            expect(buffer != NULL && found == length && strlen(buffer) < size, "string", strings[i][0]);
            if (wanted == NULL) {
                expect(buffer[0] == '\0', "string", strings[i][0]);
            } else if (length < size) {
                expect(strcmp(buffer, wanted) == 0, "string", strings[i][0]);
            } else {
                /* As many whole characters as fit. */
                const size_t kept = strlen(buffer);
                expect(memcmp(buffer, wanted, kept) == 0 && ((uint8_t)wanted[kept] & 0xc0) != 0x80, "cut", strings[i][0]);
            }
            free(buffer);
        }
        expect(lacuna_json_is(json, wanted == NULL ? "abc" : wanted) == (wanted != NULL), "is", strings[i][0]);
        expect(!lacuna_json_is(json, "ab") && !lacuna_json_is(json, "abcd"), "is not", strings[i][0]);
        free(block);
    }
}

static const struct {
    const char *json;
    double value;
} numbers[] = {
    {"0", 0.0},
    {"-0.0", -0.0},
    {" 12 ", 12.0},
    {"-2.5E+1", -25.0},
    {"1.25", 1.25},
    {"0.1", 0.1},
    {"1e-3", 0.001},
    {"0.000001234e+6", 1.234},
    {"123456789012345678901234567890", 123456789012345678901234567890.0},
    {"0.30000000000000004", 0.30000000000000004},
    {"1.7976931348623157e308", 1.7976931348623157e308},
    {"17976931348623157e292", 1.7976931348623157e308},
    {"5e-324", 5e-324},
    {"2.2250738585072014e-308", 2.2250738585072014e-308},
    {"1e400", INFINITY},
    {"-1e400", -INFINITY},
    {"1e-400", 0.0},
    {"1e99999999999999999999", INFINITY},
    {"1e-99999999999999999999", 0.0},
    {"0e99999999999999999999", 0.0},
    /* Half way between two doubles, and a little above: the last digit decides. */
    {"9007199254740993", 9007199254740992.0},
    {"9007199254740993.0000000000000000000000000000000000000000000000000001", 9007199254740994.0},
    {"{\"float\": \"inf\"}", INFINITY},
    {"{\"float\":\"-inf\"}", -INFINITY},
    {"{\"float\":\"nan\"}", NAN},
    {"null", 77.0},
    {"", 77.0},
    {"\"3\"", NAN},
    {"true", NAN},
    {"[3]", NAN},
    {"{}", NAN},
    {"-", NAN},
    {"1.", NAN},
    {".5", NAN},
    {"1e", NAN},
    {"1e+", NAN},
    {"1x", NAN},
    {"1.2.3", NAN},
    {"0x10", NAN},
    {"inf", NAN},
    {"nan", NAN},
};

static int same(double a, double b)
{
    return isnan(a) ? isnan(b) : a == b && !signbit(a) == !signbit(b);
}

static void test_numbers(void)
{
    enum { LONG = 2000 };
    static char digits[LONG + 8];
    double *list;
    LacunaText json;
    uint8_t *block;
    size_t i, count;
    for (i = 0; i < COUNT(numbers); ++i) {
        block = begin(numbers[i].json, strlen(numbers[i].json), &json);
        expect(same(lacuna_json_number(json, 77.0), numbers[i].value), "number", numbers[i].json);
        free(block);
    }
    /* Digits that no buffer holds, before and behind the point: the last one makes it more than half way. */
    memset(digits, '0', sizeof digits);
    memcpy(digits, "9007199254740993.", 17);
    digits[LONG - 1] = '1';
    block = begin(digits, LONG, &json);
    expect(lacuna_json_number(json, 0.0) == 9007199254740994.0, "number", "of many digits");
    free(block);
    memcpy(digits + 16, "0", 1);
    memcpy(digits + LONG, "e-1984", 6);
    block = begin(digits, LONG + 6, &json);
    expect(lacuna_json_number(json, 0.0) == 9007199254740994.0, "number", "of many digits and an exponent");
    free(block);

    block = begin("[1, \"x\", null,{\"float\":\"inf\"} , -4e0]", 38, &json);
    list = lacuna_json_numbers(json, &count);
    expect(list != NULL && count == 5 && list[0] == 1.0 && isnan(list[1]) && isnan(list[2]) && isinf(list[3]) &&
               list[4] == -4.0, "numbers", "of a list");
    free(list);
    list = lacuna_json_numbers(lacuna_json(json, "3"), &count);
    expect(list != NULL && count == 1 && isnan(list[0]), "numbers", "of an object");
    free(list);
    list = lacuna_json_numbers(lacuna_json(json, "9"), &count);
    expect(list != NULL && count == 0, "numbers", "of nothing");
    free(list);
    free(block);
}

static void test_truths(void)
{
    static const char *const texts[] = {"true", " false\n", "null", "", "1", "\"true\"", "truex", "[true]"};
    static const int values[] = {1, 0, 5, 5, -1, -1, -1, -1};
    size_t i;
    for (i = 0; i < COUNT(texts); ++i) {
        LacunaText json;
        uint8_t *block = begin(texts[i], strlen(texts[i]), &json);
        expect(lacuna_json_true(json, 5) == values[i], "true", texts[i]);
        free(block);
    }
}

/* Reads all that a value has in it. */
static void read_all(LacunaText json)
{
    LacunaEach each = lacuna_json_each(json);
    char buffer[5];
    size_t count;
    lacuna_json_true(json, 0);
    lacuna_json_number(json, 0.0);
    lacuna_json_string(json, buffer, sizeof buffer);
    lacuna_json_is(json, "a \"b\" ]");
    free(lacuna_json_numbers(json, &count));
    while (lacuna_json_next(&each)) {
        lacuna_json_string(each.key, buffer, sizeof buffer);
        read_all(each.value);
    }
}

/* Every beginning and every end of every text, and every text with one byte changed. */
static void test_cut(const char *text)
{
    static const char odd[] = "\"\\{}[],:u \xed";
    const size_t length = strlen(text);
    LacunaText json;
    uint8_t *block;
    size_t i, k;
    for (i = 0; i <= length; ++i) {
        block = begin(text, i, &json);
        read_all(json);
        for (k = 0; k < COUNT(paths); ++k) {
            read_all(lacuna_json(json, paths[k][1]));
        }
        free(block);
        block = begin(text + i, length - i, &json);
        read_all(json);
        free(block);
        for (k = 0; i < length && odd[k] != '\0'; ++k) {
            block = begin(text, length, &json);
            block[i] = (uint8_t)odd[k];
            read_all(json);
            free(block);
        }
    }
}

/* ---- writing ---- */

static char said[1024];
static size_t length_said = 0;

static void take_text(void *context, LacunaText text)
{
    (void)context;
    if (text.length < sizeof said - length_said) {
        memcpy(said + length_said, text.bytes, text.length);
        length_said += text.length;
        said[length_said] = '\0';
    }
}

static void take_numbers(void *context, LacunaNumbers numbers_given)
{
    *(LacunaNumbers *)context = numbers_given;
}

static LacunaText all_said(void)
{
    LacunaText text;
    text.bytes = (const uint8_t *)said;
    text.length = length_said;
    length_said = 0;
    return text;
}

static void expect_said(const char *wanted)
{
    const LacunaText text = all_said();
    expect(text.length == strlen(wanted) && memcmp(said, wanted, text.length) == 0, "said", wanted);
}

static const struct {
    double value;
    const char *json;
} written[] = {
    {0.0, "0"}, {-0.0, "-0"}, {4.0, "4"}, {-10000.0, "-10000"}, {0.1, "0.1"}, {-0.5, "-0.5"}, {1.25, "1.25"},
    {0.0001, "0.0001"}, {0.00012345, "0.00012345"}, {0.00001, "1e-5"}, {1.5e-7, "1.5e-7"}, {1234.5, "1234.5"},
    {0.30000000000000004, "0.30000000000000004"}, {1e15, "1e15"}, {1e22, "1e22"}, {1.5e300, "1.5e300"},
    {999999999999999.0, "999999999999999"}, {5e-324, "5e-324"}, {1.7976931348623157e308, "1.7976931348623157e308"},
    {2.2250738585072014e-308, "2.2250738585072014e-308"}, {123456.789, "123456.789"}, {1.0 / 3.0, "0.3333333333333333"},
    {6.02214076e23, "6.02214076e23"}, {NAN, "{\"float\":\"nan\"}"}, {INFINITY, "{\"float\":\"inf\"}"},
    {-INFINITY, "{\"float\":\"-inf\"}"},
};

static void test_writing(void)
{
    LacunaNumbers given;
    LacunaAnswer answer;
    LacunaText json = {NULL, 0};
    LacunaKey key = {{7, 7, 7, 7}};
    LacunaRandom random = lacuna_random(key);
    const double two[2] = {1.0, 2.0};
    char text[256], again[256];
    size_t i;
    answer.size = sizeof answer;
    answer.context = &given;
    answer.text = take_text;
    answer.numbers = take_numbers;

    for (i = 0; i < COUNT(written); ++i) {
        lacuna_say_number(&answer, written[i].value);
        expect_said(written[i].json);
    }
    /* Any double comes back. */
    for (i = 0; i < 2000; ++i) {
        const uint64_t bits = lacuna_bits(&random);
        double x;
        memcpy(&x, &bits, sizeof x);
        lacuna_say_number(&answer, x);
        json = all_said();
        expect(same(lacuna_json_number(json, 0.0), x) && json.length < 25, "number there and back", said);
    }

    lacuna_say_string(&answer, "a\"b\\c\n\x01\x1f/\x7f \xc3\xa9\xf0\x9f\x98\x80");
    expect_said("\"a\\u0022b\\u005cc\\u000a\\u0001\\u001f/\x7f \xc3\xa9\xf0\x9f\x98\x80\"");
    /* A lone byte, one of two, what is too long, half of a pair, and beyond the last character. */
    lacuna_say_string(&answer, "\xe9|\xc3|\xc0\x80|\xed\xa0\x80|\xf4\x90\x80\x80|\xe2\x82");
    expect_said("\"\\ufffd|\\ufffd|\\ufffd\\ufffd|\\ufffd\\ufffd\\ufffd|\\ufffd\\ufffd\\ufffd\\ufffd|\\ufffd\\ufffd\"");
    for (i = 1; i < 128; ++i) {
        text[i - 1] = (char)i;
    }
    text[127] = '\0';
    lacuna_say_string(&answer, text);
    expect(lacuna_json_string(all_said(), again, sizeof again) == 127 && strcmp(text, again) == 0, "string", "of ASCII");

    lacuna_say_value(&answer, lacuna_json(json, "nothing"));
    expect(lacuna_say_text(&answer, ";") == LACUNA_OK, "status", "of a text");
    expect_said("null;");
    expect(lacuna_fail(&answer, LACUNA_STOP, "no file") == LACUNA_STOP, "status", "of a failure");
    expect_said("no file");
    expect(lacuna_wrong_option(&answer, "width", "a \"number\"") == LACUNA_REJECTED, "status", "of an option");
    json = all_said();
    expect(lacuna_json_is(lacuna_json(json, "0/at"), "width") &&
               lacuna_json_is(lacuna_json(json, "0/message"), "wrong value for `width`") &&
               lacuna_json_is(lacuna_json(json, "0/expected"), "a \"number\""), "complaint", said);
    lacuna_give(&answer, two, 1, 2);
    expect(given.values == two && given.rows == 1 && given.columns == 2, "matrix", "of two numbers");
}

/* ---- random numbers ---- */

/* The first numbers of `splitmix64.c` from the seed 1234567 (rosettacode.org/wiki/Pseudo-random_numbers/Splitmix64), and
 * those of `xoshiro256plusplus.c` from the state 1, 2, 3, 4 (prng.di.unimi.it; listed in the tests of the crate
 * rand_xoshiro). */
static const uint64_t of_splitmix64[] = {
    UINT64_C(6457827717110365317), UINT64_C(3203168211198807973), UINT64_C(9817491932198370423),
    UINT64_C(4593380528125082431), UINT64_C(16408922859458223821),
};
static const uint64_t of_xoshiro256plusplus[] = {
    UINT64_C(41943041), UINT64_C(58720359), UINT64_C(3588806011781223), UINT64_C(3591011842654386),
    UINT64_C(9228616714210784205), UINT64_C(9973669472204895162), UINT64_C(14011001112246962877),
    UINT64_C(12406186145184390807), UINT64_C(15849039046786891736), UINT64_C(10450023813501588000),
};

static void test_random(void)
{
    enum { DRAWS = 200000 };
    LacunaRandom random = {{1, 2, 3, 4}}, other;
    LacunaKey key = {{1234567, 0, 0, 0}};
    uint64_t state = 1234567;
    double sums[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0}, least = 1.0, most = 0.0;
    size_t i;
    for (i = 0; i < COUNT(of_splitmix64); ++i) {
        expect(lacuna_splitmix64(&state) == of_splitmix64[i], "SplitMix64", "reference");
    }
    for (i = 0; i < COUNT(of_xoshiro256plusplus); ++i) {
        expect(lacuna_bits(&random) == of_xoshiro256plusplus[i], "xoshiro256++", "reference");
    }
    random = lacuna_random(key);
    expect(random.words[0] == of_splitmix64[0] && random.words[3] == UINT64_C(0xe220a8397b1dcdaf), "key", "mixed");
    key.words[3] = 1;
    other = lacuna_random(key);
    expect(lacuna_bits(&random) != lacuna_bits(&other), "keys", "of one bit");
    for (i = 0; i < DRAWS; ++i) {
        const double u = lacuna_uniform(&random), z = lacuna_normal(&random), square = z * z;
        least = u < least ? u : least;
        most = u > most ? u : most;
        sums[0] += u / DRAWS;
        sums[1] += u * u / DRAWS;
        sums[2] += z / DRAWS;
        sums[3] += square / DRAWS;
        sums[4] += square * z / DRAWS;
        sums[5] += square * square / DRAWS;
    }
    expect(least >= 0.0 && least < 1e-4 && most < 1.0 && most > 0.9999, "uniform", "range");
    /* Five standard errors of each mean. */
    expect(fabs(sums[0] - 0.5) < 0.0033 && fabs(sums[1] - 1.0 / 3.0) < 0.0034, "uniform", "moments");
    expect(fabs(sums[2]) < 0.0112 && fabs(sums[3] - 1.0) < 0.0159, "normal", "mean and variance");
    expect(fabs(sums[4]) < 0.0434 && fabs(sums[5] - 3.0) < 0.11, "normal", "third and fourth moment");
    /* No bit of the largest uniform number is lost: it is the double before one. */
    memset(&random, 0, sizeof random);
    random.words[0] = UINT64_MAX;
    random.words[3] = 1;
    expect(lacuna_uniform(&random) == 9007199254740991.0 / 9007199254740992.0, "uniform", "largest");
}

int main(void)
{
    static const char *const languages[] = {"C", "de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "fa_IR.UTF-8"};
    size_t i;
    for (i = 0; i < COUNT(languages); ++i) {
        if (setlocale(LC_ALL, languages[i]) != NULL) {
            test_numbers();
            test_writing();
        }
    }
    test_paths();
    test_elements();
    test_strings();
    test_truths();
    test_cut(spaced);
    for (i = 0; i < COUNT(strings); ++i) {
        test_cut(strings[i][0]);
    }
    for (i = 0; i < COUNT(numbers); ++i) {
        test_cut(numbers[i].json);
    }
    test_random();
    printf("%d failures\n", failures);
    return failures > 0;
}

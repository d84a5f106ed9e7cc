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

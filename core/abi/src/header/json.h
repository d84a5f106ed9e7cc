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

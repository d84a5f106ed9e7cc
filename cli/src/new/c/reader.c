/* `skeleton`: columns of text separated by commas or blanks, as instruments write them: one value a line.
 *
 * The first line has the names of the columns: one for each axis of the response, one with the name of the response, and
 * for measurements one called `replicate`, whose lines lie together. Numbers are in the units of the study; `nan` marks a
 * missing value. Other columns and other positions are ignored.
 */
#include "lacuna_plugin.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST_COLUMNS 64
#define LONGEST 4096
#define BETWEEN ", \t\r\n"

/* ---- texts ---- */

static int32_t say(const LacunaAnswer *answer, int32_t status, const char *text)
{
    lacuna_say(answer, text, strlen(text));
    return status;
}

static int32_t no_memory(const LacunaAnswer *answer)
{
    return say(answer, LACUNA_STOP, "there is no memory left");
}

/* A text as the rest of a JSON string, between two pieces of JSON. */
static void say_string(const LacunaAnswer *answer, const char *before, const char *text, const char *behind)
{
    say(answer, LACUNA_OK, before);
    for (; *text != '\0'; ++text) {
        if (*text == '"' || *text == '\\') {
            say(answer, LACUNA_OK, "\\");
        }
        lacuna_say(answer, text, 1);
    }
    say(answer, LACUNA_OK, behind);
}

/* A copy that ends with a zero, to be freed; NULL if there is no memory left. */
static char *copy_of(LacunaText text)
{
    char *copy = malloc(text.length + 1);
    if (copy != NULL) {
        if (text.length > 0) {
            memcpy(copy, text.bytes, text.length);
        }
        copy[text.length] = '\0';
    }
    return copy;
}

/* The text after a piece of JSON, which the program writes without blanks; NULL if it does not have the piece. */
static const char *after(const char *json, const char *piece)
{
    const char *at = json == NULL ? NULL : strstr(json, piece);
    return at == NULL ? NULL : at + strlen(piece);
}

/* The text that a JSON string stands for, from behind its opening quote; returns 0 if there is none or no room for it. */
static int unquoted(const char *from, char *to, size_t room)
{
    for (; from != NULL && *from != '"' && *from != '\0' && room > 1; ++from, --room) {
        from += from[0] == '\\' && from[1] != '\0';
        *to++ = *from;
    }
    *to = '\0';
    return from != NULL && *from == '"';
}

/* 1 if a JSON string, from behind its opening quote, is this text; one with a backslash is no text of a file. */
static int is(const char *json, const char *text)
{
    const size_t length = strlen(text);
    return strncmp(json, text, length) == 0 && json[length] == '"';
}

/* ---- the options ---- */

typedef struct {
    char path[LONGEST]; /* empty where there is none */
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, LACUNA_OK,
        "{\"type\":\"object\",\"description\":\"Columns of text separated by commas or blanks, one value a line. The first "
        "line has the names: the axes of the response, the response, and `replicate` for measurements.\","
        "\"additionalProperties\":false,\"properties\":{"
        "\"path\":{\"type\":\"string\",\"description\":\"File with the measurements, relative to the study.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    Plugin *plugin = calloc(1, sizeof *plugin);
    char *json = copy_of(options);
    const char *given = after(json, "\"path\":");
    int32_t status = LACUNA_OK;
    if (plugin == NULL || json == NULL) {
        status = no_memory(answer);
    } else if (given != NULL && (*given != '"' || !unquoted(given + 1, plugin->path, sizeof plugin->path))) {
        status = say(answer, LACUNA_REJECTED,
            "[{\"at\":\"path\",\"message\":\"wrong value for `path`\",\"expected\":\"the path of a file\"}]");
    } else {
        *out = plugin;
    }
    free(json);
    if (status != LACUNA_OK) {
        free(plugin);
    }
    return status;
}

/* ---- a file ---- */

typedef struct {
    FILE *file;
    size_t columns, number; /* of the line */
    char first[LONGEST], line[LONGEST];
    char *names[MOST_COLUMNS], *cells[MOST_COLUMNS];
    char reason[200]; /* why the file cannot be read */
} Sheet;

/* Ends each cell of a line with a zero and notes where it begins; returns their number. */
static size_t split(char *line, char **cells)
{
    size_t count = 0;
    for (line += strspn(line, BETWEEN); *line != '\0' && count < MOST_COLUMNS; line += strspn(line, BETWEEN)) {
        cells[count++] = line;
        line += strcspn(line, BETWEEN);
        if (*line != '\0') {
            *line++ = '\0';
        }
    }
    return count;
}

/* Goes on to the next line that is not empty; returns 0 at the end, and with a reason where a line is none. */
static int next_line(Sheet *sheet, char *line, char **cells)
{
    size_t count = 0;
    while (count == 0) {
        if (fgets(line, LONGEST, sheet->file) == NULL) {
            if (ferror(sheet->file)) {
                snprintf(sheet->reason, sizeof sheet->reason, "it cannot be read to its end");
            }
            return 0;
        }
        ++sheet->number;
        if (strchr(line, '\n') == NULL && !feof(sheet->file)) {
            snprintf(sheet->reason, sizeof sheet->reason, "line %lu: expected text of fewer than %d bytes",
                     (unsigned long)sheet->number, LONGEST);
            return 0;
        }
        count = split(line, cells);
    }
    if (sheet->columns == 0) {
        sheet->columns = count;
    }
    if (count == MOST_COLUMNS) {
        snprintf(sheet->reason, sizeof sheet->reason, "line %lu: expected fewer than %d columns",
                 (unsigned long)sheet->number, MOST_COLUMNS);
        return 0;
    }
    if (count != sheet->columns) {
        snprintf(sheet->reason, sizeof sheet->reason, "line %lu: expected %lu columns, found %lu",
                 (unsigned long)sheet->number, (unsigned long)sheet->columns, (unsigned long)count);
    }
    return count == sheet->columns;
}

/* Opens a file and reads the names; returns 0 with a reason if that is not possible. */
static int open_sheet(Sheet *sheet, const char *path)
{
    memset(sheet, 0, sizeof *sheet);
    sheet->file = fopen(path, "rb");
    if (sheet->file != NULL && next_line(sheet, sheet->first, sheet->names)) {
        return 1;
    }
    if (sheet->reason[0] == '\0') {
        snprintf(sheet->reason, sizeof sheet->reason, "it cannot be read, or has no line");
    }
    return 0;
}

static void close_sheet(Sheet *sheet)
{
    if (sheet->file != NULL) {
        fclose(sheet->file);
    }
}

/* Answers why a file cannot be read. */
static int32_t refuse(const Sheet *sheet, const char *path, const LacunaAnswer *answer)
{
    say_string(answer, "{\"path\":\"", path, "\",");
    say_string(answer, "\"message\":\"", sheet->reason, "\"}");
    return LACUNA_REJECTED;
}

/* The cell in the column of a name, which is a JSON string from behind its quote; NULL with a reason if there is none. */
static const char *cell(Sheet *sheet, const char *name)
{
    size_t j;
    for (j = 0; j < sheet->columns; ++j) {
        if (is(name, sheet->names[j])) {
            return sheet->cells[j];
        }
    }
    snprintf(sheet->reason, sizeof sheet->reason, "there is no column `%.*s`", (int)strcspn(name, "\""), name);
    return NULL;
}

/* ---- the response in a file ---- */

/* The index of a cell among the labels or numbers of an axis, and their count; the count if it is elsewhere. */
static size_t position(const char *coordinates, const char *text, size_t *count)
{
    const int labels = strncmp(coordinates, "\"labels\"", 8) == 0;
    const char *at = strchr(coordinates, '[');
    const double x = labels ? 0.0 : strtod(text, NULL);
    size_t i = 0, found = SIZE_MAX;
    /* Each entry stands behind a bracket or a comma. */
    for (; at != NULL && *at != ']' && *at != '\0' && at[1] != ']'; ++i) {
        char *end = NULL;
        const double y = labels ? 0.0 : strtod(at + 1, &end);
        if (labels ? is(at + 2, text) : fabs(x - y) <= 1e-9 * fabs(y) || x == y) {
            found = i;
        }
        for (at += 2; labels && *at != '"' && *at != '\0'; ++at) {
            at += at[0] == '\\' && at[1] != '\0';
        }
        at = labels ? at + (*at == '"') : end;
    }
    *count = i;
    return found < i ? found : i;
}

/* Puts the value of a line into its place in the response; returns 0 with a reason if that is not possible. */
static int put(Sheet *sheet, const char *layout, double *values, size_t outputs)
{
    const char *text = cell(sheet, after(layout, "{\"name\":\"")), *at = after(layout, "\"axes\":[");
    size_t index = 0, count, i;
    char *end;
    double y;
    while (text != NULL && (at = after(at, "{\"name\":\"")) != NULL) {
        const char *where = cell(sheet, at);
        if (where == NULL) {
            return 0;
        }
        at = after(at, "\"coordinates\":{");
        i = position(at, where, &count);
        if (i == count) {
            return 1;
        }
        index = index * count + i;
    }
    if (text == NULL || index >= outputs) {
        return 0;
    }
    y = strtod(text, &end);
    if (end == text || *end != '\0' || isinf(y) || !isnan(values[index])) {
        snprintf(sheet->reason, sizeof sheet->reason, "line %lu: expected one finite number for each place, found `%.80s`",
                 (unsigned long)sheet->number, text);
        return 0;
    }
    values[index] = y;
    return 1;
}

/* Reads the values of a response, all of which must be there; the reason, if they are not, is in the sheet. */
static void read_response(Sheet *sheet, const char *file, const char *layout, double *values, size_t outputs)
{
    size_t i;
    for (i = 0; i < outputs; ++i) {
        values[i] = NAN;
    }
    if (open_sheet(sheet, file)) {
        while (next_line(sheet, sheet->line, sheet->cells) && put(sheet, layout, values, outputs)) {
        }
    }
    for (i = 0; i < outputs && sheet->reason[0] == '\0'; ++i) {
        if (isnan(values[i])) {
            snprintf(sheet->reason, sizeof sheet->reason, "there is no value %lu of %lu", (unsigned long)(i + 1),
                     (unsigned long)outputs);
        }
    }
    close_sheet(sheet);
}

static int32_t response(void *plugin, LacunaText path, LacunaText layout, size_t outputs, double *values,
                        const LacunaAnswer *answer)
{
    char *file = copy_of(path), *shape = copy_of(layout);
    int32_t status;
    Sheet sheet;
    (void)plugin;
    if (file == NULL || shape == NULL) {
        status = no_memory(answer);
    } else {
        read_response(&sheet, file, shape, values, outputs);
        status = sheet.reason[0] == '\0' ? LACUNA_OK : refuse(&sheet, file, answer);
    }
    free(file);
    free(shape);
    return status;
}

/* ---- what is in a file ---- */

/* A table has at least two names in a first line that is text. */
static int32_t recognises(void *plugin, LacunaText path, LacunaText head)
{
    char line[LONGEST + 1], *cells[MOST_COLUMNS];
    const size_t length = head.length < LONGEST ? head.length : LONGEST;
    (void)plugin;
    (void)path;
    if (length == 0 || memchr(head.bytes, 0, length) != NULL) {
        return 0;
    }
    memcpy(line, head.bytes, length);
    line[length] = '\0';
    line[strcspn(line, "\n")] = '\0';
    return split(line, cells) > 1;
}

/* All numbers of a file, to be freed, line by line; what is no number, such as a label, is NaN. */
static double *numbers_of(Sheet *sheet, size_t *rows)
{
    double *values = NULL, *longer;
    size_t j;
    char *end;
    while (next_line(sheet, sheet->line, sheet->cells)) {
        longer = realloc(values, (*rows + 1) * sheet->columns * sizeof *values);
        if (longer == NULL) {
            snprintf(sheet->reason, sizeof sheet->reason, "there is no memory left");
            break;
        }
        values = longer;
        for (j = 0; j < sheet->columns; ++j) {
            const double x = strtod(sheet->cells[j], &end);
            values[*rows * sheet->columns + j] = *end == '\0' ? x : NAN;
        }
        ++*rows;
    }
    return values;
}

/* Each column is a variable, with its numbers as a matrix of one column, which is put together in `column`. */
static void say_columns(const Sheet *sheet, const double *values, size_t rows, double *column, const LacunaAnswer *answer)
{
    size_t i, j;
    say(answer, LACUNA_OK, "{\"format\":\"columns of text\",\"facts\":[],\"variables\":[");
    for (j = 0; j < sheet->columns; ++j) {
        char text[80];
        for (i = 0; i < rows; ++i) {
            column[i] = values[i * sheet->columns + j];
        }
        lacuna_give(answer, column, rows, 1);
        snprintf(text, sizeof text, ",\"on\":\"column\",\"axes\":[[\"line\",%lu]],\"columns\":[", (unsigned long)rows);
        say_string(answer, j == 0 ? "{\"name\":\"" : ",{\"name\":\"", sheet->names[j], "\"");
        say(answer, LACUNA_OK, text);
        say_string(answer, "{\"name\":\"", sheet->names[j], "\"}]}");
    }
    say(answer, LACUNA_OK, "]}");
}

static int32_t inspect(void *plugin, LacunaText path, const LacunaAnswer *answer)
{
    char *file = copy_of(path);
    double *values = NULL, *column = NULL;
    int32_t status = LACUNA_OK;
    size_t rows = 0;
    Sheet sheet;
    (void)plugin;
    if (file == NULL) {
        return no_memory(answer);
    }
    if (open_sheet(&sheet, file)) {
        values = numbers_of(&sheet, &rows);
        column = malloc((rows + 1) * sizeof *column);
    }
    if (sheet.reason[0] != '\0') {
        status = refuse(&sheet, file, answer);
    } else if (column == NULL) {
        status = no_memory(answer);
    } else {
        say_columns(&sheet, values, rows, column, answer);
    }
    close_sheet(&sheet);
    free(values);
    free(column);
    free(file);
    return status;
}

/* ---- measurements ---- */

static int32_t names_files(void *plugin)
{
    return ((const Plugin *)plugin)->path[0] != '\0';
}

/* The file with the measurements of a source; returns 0 if there is none. */
static int file_of(const Plugin *plugin, const char *source, char *file)
{
    char folder[LONGEST];
    if (plugin->path[0] == '\0' || !unquoted(after(source, "\"directory\":\""), folder, sizeof folder)) {
        return 0;
    }
    snprintf(file, 2 * LONGEST, plugin->path[0] == '/' ? "%.0s%s" : "%s/%s", folder, plugin->path);
    return 1;
}

static int32_t files(void *plugin, LacunaText source, const LacunaAnswer *answer)
{
    char *json = copy_of(source), file[2 * LONGEST];
    if (json == NULL) {
        return no_memory(answer);
    }
    if (file_of(plugin, json, file)) {
        say_string(answer, "[\"", file, "\"]");
    } else {
        say(answer, LACUNA_OK, "[]");
    }
    free(json);
    return LACUNA_OK;
}

/* 1 if the line begins another replicate than `last`, which becomes its name; the lines of one lie together. */
static int begins(Sheet *sheet, char *last)
{
    const char *name = cell(sheet, "replicate\"");
    if (name == NULL || strcmp(name, last) == 0) {
        return 0;
    }
    strcpy(last, name);
    return 1;
}

/* The values of all replicates, to be freed, and their number; with a reason if a line cannot be read. */
static double *read_all(Sheet *sheet, const char *layout, size_t outputs, size_t *count)
{
    char last[LONGEST] = "";
    double *values = NULL, *longer;
    size_t i;
    while (next_line(sheet, sheet->line, sheet->cells) && sheet->reason[0] == '\0') {
        if (begins(sheet, last)) {
            longer = realloc(values, (*count + 1) * outputs * sizeof *values);
            if (longer == NULL) {
                snprintf(sheet->reason, sizeof sheet->reason, "there is no memory left");
                break;
            }
            values = longer;
            for (i = 0; i < outputs; ++i) {
                values[*count * outputs + i] = NAN;
            }
            ++*count;
        }
        if (*count == 0 || !put(sheet, layout, values + (*count - 1) * outputs, outputs)) {
            break;
        }
    }
    return values;
}

/* The names of the replicates, a JSON list; the file has been read before. */
static void say_names(const char *file, const LacunaAnswer *answer)
{
    char last[LONGEST] = "";
    const char *before = "[\"";
    Sheet sheet;
    if (open_sheet(&sheet, file)) {
        while (next_line(&sheet, sheet.line, sheet.cells)) {
            if (begins(&sheet, last)) {
                say_string(answer, before, last, "\"");
                before = ",\"";
            }
        }
    }
    close_sheet(&sheet);
    say(answer, LACUNA_OK, "]");
}

/* The number of values that a layout has. */
static size_t size_of(const char *layout)
{
    const char *at = after(layout, "\"axes\":[");
    size_t outputs = 1, count;
    while ((at = after(at, "\"coordinates\":{")) != NULL) {
        position(at, "", &count);
        outputs *= count;
    }
    return outputs;
}

static int32_t measurements(void *plugin, LacunaText source, const LacunaAnswer *answer)
{
    char *json = copy_of(source), file[2 * LONGEST];
    const char *layout = after(json, "\"layout\":");
    size_t count = 0, outputs;
    double *values = NULL;
    int32_t status = LACUNA_OK;
    Sheet sheet;
    if (layout == NULL || !file_of(plugin, json, file)) {
        free(json);
        return say(answer, LACUNA_REJECTED, "missing key `path`: the file with the measurements");
    }
    outputs = size_of(layout);
    if (open_sheet(&sheet, file)) {
        values = read_all(&sheet, layout, outputs, &count);
    }
    if (count == 0 && sheet.reason[0] == '\0') {
        snprintf(sheet.reason, sizeof sheet.reason, "there is no line of values");
    }
    if (sheet.reason[0] != '\0') {
        status = refuse(&sheet, file, answer);
    } else {
        lacuna_give(answer, values, count, outputs);
        say_names(file, answer);
    }
    close_sheet(&sheet);
    free(values);
    free(json);
    return status;
}

/* ---- the library ---- */

static const LacunaComponentFunctions component = {
    .size = sizeof(LacunaComponentFunctions), .schema = schema, .create = create, .destroy = free
};

static const LacunaReaderFunctions reader = {
    .size = sizeof(LacunaReaderFunctions), .recognises = recognises, .inspect = inspect, .names_files = names_files,
    .files = files, .measurements = measurements, .response = response
};

static const LacunaEntry entries[] = {
    LACUNA_ENTRY("reader", "skeleton", component, reader)
};

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("reader", "skeleton"), entries);

/* `skeleton`: columns of text separated by commas or blanks, as instruments write them: one value a line.
 *
 * The first line has the names of the columns: one for each axis of the response, one with the name of the response, and
 * for measurements one called `replicate`, whose lines lie together. Numbers are in the units of the study; `nan` marks a
 * missing value. Other columns and other positions are ignored.
 */
#include "lacuna_plugin.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST_AXES 16
#define LONGEST 4096
#define BETWEEN ", \t\r"

/* ---- the options ---- */

typedef struct {
    char path[LONGEST]; /* empty where there is none */
} Plugin;

static int32_t schema(const LacunaAnswer *answer)
{
    return lacuna_say_text(answer,
        "{\"type\":\"object\",\"description\":\"Columns of text separated by commas or blanks, one value a line. The first "
        "line has the names: the axes of the response, the response, and `replicate` for measurements.\","
        "\"additionalProperties\":false,\"properties\":{"
        "\"path\":{\"type\":\"string\",\"description\":\"File with the measurements, relative to the study.\"}}}");
}

static int32_t create(LacunaText options, void **out, const LacunaAnswer *answer)
{
    const LacunaText path = lacuna_json(options, "path");
    Plugin *plugin = calloc(1, sizeof *plugin);
    if (plugin == NULL) {
        return lacuna_fail(answer, LACUNA_STOP, "there is no memory left");
    }
    if (path.length > 0 && lacuna_json_string(path, plugin->path, sizeof plugin->path) >= sizeof plugin->path) {
        free(plugin);
        return lacuna_wrong_option(answer, "path", "the path of a file");
    }
    *out = plugin;
    return LACUNA_OK;
}

/* ---- a file ---- */

typedef struct {
    size_t rows, columns;
    char path[2 * LONGEST];
    char reason[200]; /* why the file cannot be read */
    char *text;       /* the whole file, with a zero behind each cell */
    char **cells;     /* rows x columns; the first row has the names */
} Sheet;

/* Notes why a file cannot be read, and the text that is wrong if there is one, unless a reason is known already. */
static void fault(Sheet *sheet, const char *reason, const char *found)
{
    if (sheet->reason[0] == '\0') {
        snprintf(sheet->reason, sizeof sheet->reason, found == NULL ? "%s" : "%s `%.80s`", reason, found);
    }
}

/* Ends each cell of a line with a zero and notes where it begins; returns their number. */
static size_t split(char *line, char **cells)
{
    size_t count = 0;
    for (line += strspn(line, BETWEEN); *line != '\0'; line += strspn(line, BETWEEN)) {
        cells[count++] = line;
        line += strcspn(line, BETWEEN);
        if (*line != '\0') {
            *line++ = '\0';
        }
    }
    return count;
}

/* Reads the file of this path; there is a reason in the sheet if that is not possible. */
static void open_sheet(Sheet *sheet, const char *path, size_t length)
{
    FILE *file;
    char *line, *next;
    long size = 0;
    memset(sheet, 0, sizeof *sheet);
    memcpy(sheet->path, path, length < sizeof sheet->path ? length : sizeof sheet->path - 1);
    file = fopen(sheet->path, "rb");
    if (file != NULL && fseek(file, 0, SEEK_END) == 0 && (size = ftell(file)) >= 0 &&
        size < LONG_MAX) { /* which a folder has */
        rewind(file);
        sheet->text = calloc((size_t)size + 1, 1);
        /* Between two cells is at least one byte. */
        sheet->cells = calloc((size_t)size / 2 + 1, sizeof *sheet->cells);
    }
    if (sheet->text == NULL || sheet->cells == NULL || fread(sheet->text, 1, (size_t)size, file) != (size_t)size) {
        fault(sheet, "it cannot be read", NULL);
    } else if (strlen(sheet->text) != (size_t)size) {
        fault(sheet, "it is no text", NULL);
    }
    if (file != NULL) {
        fclose(file);
    }
    for (line = sheet->text; sheet->reason[0] == '\0' && *line != '\0'; line = next) {
        size_t count;
        next = line + strcspn(line, "\n");
        *next = '\0';
        next += next < sheet->text + size;
        count = split(line, sheet->cells + sheet->rows * sheet->columns);
        sheet->columns = sheet->rows == 0 ? count : sheet->columns;
        sheet->rows += count > 0;
        if (count > 0 && count != sheet->columns) {
            fault(sheet, "expected a cell in each column, found the line of", line + strspn(line, BETWEEN));
        }
    }
    if (sheet->rows < 2) {
        fault(sheet, "it has no line of values", NULL);
    }
}

/* So many NaN, to be freed; there is a reason in the sheet if there is no memory left. */
static double *all_missing(Sheet *sheet, size_t count)
{
    double *values = malloc((count + 1) * sizeof *values);
    size_t i;
    for (i = 0; values != NULL && i < count; ++i) {
        values[i] = NAN;
    }
    if (values == NULL) {
        fault(sheet, "there is no memory left", NULL);
    }
    return values;
}

static void close_sheet(Sheet *sheet)
{
    free(sheet->text);
    free(sheet->cells);
}

/* Answers why a file cannot be read. */
static int32_t refuse(const Sheet *sheet, const LacunaAnswer *answer)
{
    lacuna_say_text(answer, "{\"path\":");
    lacuna_say_string(answer, sheet->path);
    lacuna_say_text(answer, ",\"message\":");
    lacuna_say_string(answer, sheet->reason);
    return lacuna_fail(answer, LACUNA_REJECTED, "}");
}

/* The column of a name, which is JSON; with a reason in the sheet if there is none. */
static size_t column_of(Sheet *sheet, LacunaText name)
{
    char text[100];
    size_t j;
    for (j = 0; j < sheet->columns; ++j) {
        if (lacuna_json_is(name, sheet->cells[j])) {
            return j;
        }
    }
    lacuna_json_string(name, text, sizeof text);
    fault(sheet, "there is no column", text);
    return j;
}

/* ---- the response in a file ---- */

/* An axis: its column, and a JSON list of its labels or numbers. */
typedef struct {
    size_t column, count;
    LacunaText places;
} Axis;

typedef struct {
    size_t column, outputs, rank;
    Axis axes[MOST_AXES];
} Response;

/* A response in the columns of a file; there is a reason in the sheet if it is not there. */
static Response find_response(LacunaText layout, Sheet *sheet)
{
    LacunaEach each = lacuna_json_each(lacuna_json(layout, "axes"));
    Response wanted = {0};
    wanted.column = column_of(sheet, lacuna_json(layout, "name"));
    wanted.outputs = 1;
    for (; lacuna_json_next(&each) && wanted.rank < MOST_AXES; ++wanted.rank) {
        const LacunaText labels = lacuna_json(each.value, "coordinates/labels");
        Axis *axis = &wanted.axes[wanted.rank];
        axis->column = column_of(sheet, lacuna_json(each.value, "name"));
        axis->places = labels.length > 0 ? labels : lacuna_json(each.value, "coordinates/grid/values");
        axis->count = lacuna_json_count(axis->places);
        wanted.outputs *= axis->count;
    }
    return wanted;
}

/* 1 if a cell is this label, or this number. */
static int is_place(LacunaText place, const char *cell)
{
    const double x = strtod(cell, NULL), y = lacuna_json_number(place, NAN);
    return lacuna_json_is(place, cell) || fabs(x - y) <= 1e-9 * fabs(y);
}

/* Puts the value of a row into its place in the response; there is a reason in the sheet if that is not possible. */
static void put(Sheet *sheet, char *const *row, const Response *wanted, double *values)
{
    size_t index = 0, i;
    char *end;
    double y;
    for (i = 0; i < wanted->rank; ++i) {
        const Axis *axis = &wanted->axes[i];
        LacunaEach each = lacuna_json_each(axis->places);
        size_t at = 0;
        while (lacuna_json_next(&each) && !is_place(each.value, row[axis->column])) {
            ++at;
        }
        if (at == axis->count) {
            return;
        }
        index = index * axis->count + at;
    }
    y = strtod(row[wanted->column], &end);
    if (end == row[wanted->column] || *end != '\0' || isinf(y) || !isnan(values[index])) {
        fault(sheet, "expected one finite number for each place, found", row[wanted->column]);
    }
    values[index] = y;
}

/* All values of a response in one file, none of which may be missing. */
static int32_t response(void *plugin, LacunaText path, LacunaText layout, size_t outputs, double *values,
                        const LacunaAnswer *answer)
{
    Response wanted;
    Sheet sheet;
    size_t i;
    (void)plugin;
    open_sheet(&sheet, (const char *)path.bytes, path.length);
    wanted = find_response(layout, &sheet);
    for (i = 0; i < outputs; ++i) {
        values[i] = NAN;
    }
    for (i = 1; i < sheet.rows && sheet.reason[0] == '\0' && wanted.outputs == outputs; ++i) {
        put(&sheet, sheet.cells + i * sheet.columns, &wanted, values);
    }
    for (i = 0; i < outputs; ++i) {
        if (isnan(values[i])) {
            fault(&sheet, "a value is missing", NULL);
        }
    }
    close_sheet(&sheet);
    return sheet.reason[0] == '\0' ? LACUNA_OK : refuse(&sheet, answer);
}

/* ---- what is in a file ---- */

/* A table has at least two names in a first line that is text. */
static int32_t recognises(void *plugin, LacunaText path, LacunaText head)
{
    size_t count = 0, i;
    int between = 1;
    (void)plugin;
    (void)path;
    for (i = 0; i < head.length && head.bytes[i] != '\n'; ++i) {
        const int was = between;
        between = strchr(BETWEEN, head.bytes[i]) != NULL;
        count += was && !between;
    }
    return count > 1 && memchr(head.bytes, 0, head.length) == NULL;
}

/* Each column is a variable, with its numbers as a matrix of one column; what is none, such as a label, is NaN. */
static int32_t inspect(void *plugin, LacunaText path, const LacunaAnswer *answer)
{
    double *values;
    size_t i, j;
    Sheet sheet;
    (void)plugin;
    open_sheet(&sheet, (const char *)path.bytes, path.length);
    values = all_missing(&sheet, sheet.rows);
    for (j = 0; j < sheet.columns && sheet.reason[0] == '\0'; ++j) {
        for (i = 1; i < sheet.rows; ++i) {
            char *end;
            const double x = strtod(sheet.cells[i * sheet.columns + j], &end);
            values[i - 1] = *end == '\0' ? x : NAN;
        }
        lacuna_give(answer, values, sheet.rows - 1, 1);
        lacuna_say_text(answer, j > 0 ? "," : "{\"format\":\"columns of text\",\"facts\":[],\"variables\":[");
        lacuna_say_text(answer, "{\"name\":");
        lacuna_say_string(answer, sheet.cells[j]);
        lacuna_say_text(answer, ",\"on\":\"column\",\"axes\":[[\"line\",");
        lacuna_say_number(answer, (double)(sheet.rows - 1));
        lacuna_say_text(answer, "]],\"columns\":[{\"name\":");
        lacuna_say_string(answer, sheet.cells[j]);
        lacuna_say_text(answer, "}]}");
    }
    free(values);
    close_sheet(&sheet);
    return sheet.reason[0] == '\0' ? lacuna_say_text(answer, "]}") : refuse(&sheet, answer);
}

/* ---- measurements ---- */

static int32_t names_files(void *plugin)
{
    return ((const Plugin *)plugin)->path[0] != '\0';
}

/* The file with the measurements of a source; returns 0 if there is none. */
static int file_of(const Plugin *plugin, LacunaText source, char *file)
{
    char folder[LONGEST];
    if (plugin->path[0] == '\0' ||
        lacuna_json_string(lacuna_json(source, "directory"), folder, sizeof folder) >= sizeof folder) {
        return 0;
    }
    snprintf(file, 2 * LONGEST, plugin->path[0] == '/' ? "%.0s%s" : "%s/%s", folder, plugin->path);
    return 1;
}

static int32_t files(void *plugin, LacunaText source, const LacunaAnswer *answer)
{
    char file[2 * LONGEST];
    if (!file_of(plugin, source, file)) {
        return lacuna_say_text(answer, "[]");
    }
    lacuna_say_text(answer, "[");
    lacuna_say_string(answer, file);
    return lacuna_say_text(answer, "]");
}

/* 1 if a row of values is the first one of a replicate. */
static int begins(const Sheet *sheet, size_t row, size_t column)
{
    char *const *cell = sheet->cells + row * sheet->columns + column;
    return row == 1 || strcmp(cell[0], (cell - sheet->columns)[0]) != 0;
}

/* The names of the replicates, a JSON list. */
static void say_names(const Sheet *sheet, size_t column, const LacunaAnswer *answer)
{
    size_t i;
    for (i = 1; i < sheet->rows; ++i) {
        if (begins(sheet, i, column)) {
            lacuna_say_text(answer, i == 1 ? "[" : ",");
            lacuna_say_string(answer, sheet->cells[i * sheet->columns + column]);
        }
    }
    lacuna_say_text(answer, "]");
}

static int32_t measurements(void *plugin, LacunaText source, const LacunaAnswer *answer)
{
    static const LacunaText replicate = LACUNA_TEXT("\"replicate\"");
    double *values;
    char file[2 * LONGEST];
    Response wanted;
    size_t column, i, count = 0;
    Sheet sheet;
    if (!file_of(plugin, source, file)) {
        return lacuna_fail(answer, LACUNA_REJECTED, "missing key `path`: the file with the measurements");
    }
    open_sheet(&sheet, file, strlen(file));
    wanted = find_response(lacuna_json(source, "layout"), &sheet);
    column = column_of(&sheet, replicate);
    for (i = 1; i < sheet.rows && sheet.reason[0] == '\0'; ++i) {
        count += begins(&sheet, i, column);
    }
    values = all_missing(&sheet, count * wanted.outputs);
    for (i = 1, count = 0; i < sheet.rows && sheet.reason[0] == '\0'; ++i) {
        count += begins(&sheet, i, column);
        put(&sheet, sheet.cells + i * sheet.columns, &wanted, values + (count - 1) * wanted.outputs);
    }
    if (sheet.reason[0] == '\0') {
        lacuna_give(answer, values, count, wanted.outputs);
        say_names(&sheet, column, answer);
    }
    free(values);
    close_sheet(&sheet);
    return sheet.reason[0] == '\0' ? LACUNA_OK : refuse(&sheet, answer);
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

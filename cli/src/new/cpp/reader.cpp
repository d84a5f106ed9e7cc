/* `skeleton`: columns of text separated by commas or blanks, as instruments write them: one value a line.
 *
 * The first line has the names of the columns: one for each axis of the response, one with the name of the response, and
 * for measurements one called `replicate`. Numbers are in the units of the study; `nan` marks a missing value. Other
 * columns and other positions are ignored.
 */
#include "lacuna_plugin.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

using lacuna::guard;
using lacuna::Rejected;
using lacuna::say;
using lacuna::string_of;
using lacuna::wrong_option;

/* The text that a JSON string stands for; empty if the value is no string. */
std::string unquoted(LacunaText json)
{
    const size_t length = lacuna_json_string(json, nullptr, 0);
    std::string text(length == SIZE_MAX ? 0 : length, ' ');
    lacuna_json_string(json, text.data(), text.size() + 1);
    return text;
}

/* A JSON string. */
std::string quoted(const std::string &text)
{
    std::string json;
    const auto append = [](void *to, LacunaText piece) { *static_cast<std::string *>(to) += string_of(piece); };
    const LacunaAnswer answer{sizeof answer, &json, append, nullptr};
    lacuna_say_string(&answer, text.c_str());
    return json;
}

/* ---- the options ---- */

struct Plugin {
    std::string path; /* empty where there is none */

    explicit Plugin(LacunaText options)
    {
        const LacunaText given = lacuna_json(options, "path");
        path = unquoted(given);
        if (given.length > 0 && lacuna_json_string(given, nullptr, 0) == SIZE_MAX) {
            throw wrong_option("path", "the path of a file");
        }
    }

    std::string file(LacunaText source) const
    {
        if (path.empty()) {
            throw Rejected("missing key `path`: the file with the measurements");
        }
        return path[0] == '/' ? path : unquoted(lacuna_json(source, "directory")) + "/" + path;
    }
};

int32_t schema(const LacunaAnswer *answer)
{
    return say(answer, R"({
    "type": "object",
    "description": "Columns of text separated by commas or blanks, one value a line. The first line has the )"
    R"(names: the axes of the response, the response, and `replicate` for measurements.",
    "additionalProperties": false,
    "properties": {
        "path": {"type": "string", "description": "File with the measurements, relative to the study."}
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

/* ---- a file ---- */

using Cells = std::vector<std::string>;

Cells split(const std::string &line)
{
    constexpr const char *between = ", \t\r";
    Cells cells;
    for (size_t at = line.find_first_not_of(between); at != std::string::npos;) {
        const size_t end = line.find_first_of(between, at);
        cells.push_back(line.substr(at, end - at));
        at = line.find_first_not_of(between, end);
    }
    return cells;
}

struct Sheet {
    std::string path;
    Cells names;
    std::vector<Cells> lines;

    explicit Sheet(const std::string &file) : path(file)
    {
        std::ifstream stream(file);
        std::string line;
        for (size_t number = 1; std::getline(stream, line); ++number) {
            if (line.find('\0') != std::string::npos) {
                throw refusal("line " + std::to_string(number) + ": expected text");
            }
            Cells cells = split(line);
            if (!names.empty() && !cells.empty() && cells.size() != names.size()) {
                throw refusal("line " + std::to_string(number) + ": expected " + std::to_string(names.size()) +
                              " columns, found " + std::to_string(cells.size()));
            }
            if (names.empty()) {
                names = std::move(cells);
            } else if (!cells.empty()) {
                lines.push_back(std::move(cells));
            }
        }
        if (stream.bad() || names.empty()) {
            throw refusal("it cannot be read, or has no line");
        }
    }

    Rejected refusal(const std::string &message) const
    {
        return Rejected(R"({"path":)" + quoted(path) + R"(,"message":)" + quoted(message) + "}");
    }

    size_t column(const std::string &name) const
    {
        const auto at = std::find(names.begin(), names.end(), name);
        if (at == names.end()) {
            throw refusal("there is no column `" + name + "`; the first one is `" + names[0] + "`");
        }
        return static_cast<size_t>(at - names.begin());
    }
};

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

/* The number that a text is; NaN if it is none. */
double number(const std::string &text)
{
    char *end = nullptr;
    const double x = std::strtod(text.c_str(), &end);
    return *end == '\0' ? x : missing;
}

/* ---- the response in a file ---- */

/* An axis of the response: its labels, or its numbers. */
struct Axis {
    size_t column = 0;
    Cells labels;
    std::vector<double> grid;
    /* The index of a cell among them; their number if it is elsewhere. */
    size_t position(const std::string &cell) const
    {
        if (!labels.empty()) {
            return static_cast<size_t>(std::find(labels.begin(), labels.end(), cell) - labels.begin());
        }
        const double x = number(cell);
        const auto near = [x](double y) { return x == y || std::abs(x - y) <= 1e-9 * std::abs(y); };
        return static_cast<size_t>(std::find_if(grid.begin(), grid.end(), near) - grid.begin());
    }
};

/* A response, in the columns of a file. */
struct Response {
    size_t column = 0, size = 1;
    std::vector<Axis> axes;

    Response(LacunaText layout, const Sheet &sheet) : column(sheet.column(unquoted(lacuna_json(layout, "name"))))
    {
        for (LacunaEach each = lacuna_json_each(lacuna_json(layout, "axes")); lacuna_json_next(&each) != 0;) {
            Axis axis;
            axis.column = sheet.column(unquoted(lacuna_json(each.value, "name")));
            LacunaEach place = lacuna_json_each(lacuna_json(each.value, "coordinates/labels"));
            while (lacuna_json_next(&place) != 0) {
                axis.labels.push_back(unquoted(place.value));
            }
            place = lacuna_json_each(lacuna_json(each.value, "coordinates/grid/values"));
            while (lacuna_json_next(&place) != 0) {
                axis.grid.push_back(lacuna_json_number(place.value, missing));
            }
            size *= axis.labels.size() + axis.grid.size();
            axes.push_back(std::move(axis));
        }
    }

    /* Puts the value of a line into its place among `values`; one that is elsewhere is left out. */
    void put(const Sheet &sheet, const Cells &cells, std::vector<double> &values) const
    {
        size_t index = 0;
        for (const Axis &axis : axes) {
            const size_t count = axis.labels.size() + axis.grid.size(), i = axis.position(cells[axis.column]);
            if (i == count) {
                return;
            }
            index = index * count + i;
        }
        const double y = number(cells[column]);
        if (std::isinf(y) || (std::isnan(y) && cells[column] != "nan") || !std::isnan(values.at(index))) {
            throw sheet.refusal("expected one finite number for each place, found `" + cells[column] + "`");
        }
        values[index] = y;
    }
};

int32_t response(void *, LacunaText path, LacunaText layout, size_t outputs, double *out, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const Sheet sheet(string_of(path));
        const Response wanted(layout, sheet);
        std::vector<double> values(outputs, missing);
        for (const Cells &cells : sheet.lines) {
            wanted.put(sheet, cells, values);
        }
        for (size_t i = 0; i < outputs; ++i) {
            if (std::isnan(values[i])) {
                throw sheet.refusal("there is no value " + std::to_string(i + 1) + " of " + std::to_string(outputs));
            }
        }
        std::copy(values.begin(), values.end(), out);
    });
}

/* ---- what is in a file ---- */

/* A table has at least two names in a first line that is text. */
int32_t recognises(void *, LacunaText, LacunaText head)
{
    try {
        const std::string text = string_of(head);
        return text.find('\0') == std::string::npos && split(text.substr(0, text.find('\n'))).size() > 1;
    } catch (...) {
        return 0;
    }
}

/* Each column is a variable, with its numbers as a matrix of one column; what is no number, such as a label, is NaN. */
int32_t inspect(void *, LacunaText path, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const Sheet sheet(string_of(path));
        const std::string axes = R"(,"on":"column","axes":[["line",)" + std::to_string(sheet.lines.size()) + "]]";
        std::string variables;
        for (size_t j = 0; j < sheet.names.size(); ++j) {
            std::vector<double> values;
            for (const Cells &cells : sheet.lines) {
                values.push_back(number(cells[j]));
            }
            lacuna_give(answer, values.data(), values.size(), 1);
            const std::string name = R"({"name":)" + quoted(sheet.names[j]);
            variables += (j == 0 ? "" : ",") + name + axes + R"(,"columns":[)" + name + "}]}";
        }
        say(answer, R"({"format":"columns of text","facts":[],"variables":[)" + variables + "]}");
    });
}

/* ---- measurements ---- */

int32_t names_files(void *plugin)
{
    return !static_cast<const Plugin *>(plugin)->path.empty();
}

int32_t files(void *plugin, LacunaText source, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const auto &p = *static_cast<const Plugin *>(plugin);
        say(answer, p.path.empty() ? "[]" : "[" + quoted(p.file(source)) + "]");
    });
}

int32_t measurements(void *plugin, LacunaText source, const LacunaAnswer *answer)
{
    return guard(answer, [&] {
        const Sheet sheet(static_cast<const Plugin *>(plugin)->file(source));
        const Response wanted(lacuna_json(source, "layout"), sheet);
        const size_t replicate = sheet.column("replicate");
        Cells names;
        std::vector<std::vector<double>> rows;
        for (const Cells &cells : sheet.lines) {
            const auto at = std::find(names.begin(), names.end(), cells[replicate]);
            const size_t row = static_cast<size_t>(at - names.begin());
            if (row == names.size()) {
                names.push_back(cells[replicate]);
                rows.emplace_back(wanted.size, missing);
            }
            wanted.put(sheet, cells, rows[row]);
        }
        std::string list;
        std::vector<double> values;
        for (size_t row = 0; row < names.size(); ++row) {
            list += (row == 0 ? "" : ",") + quoted(names[row]);
            values.insert(values.end(), rows[row].begin(), rows[row].end());
        }
        lacuna_give(answer, values.data(), names.size(), wanted.size);
        say(answer, "[" + list + "]");
    });
}

/* ---- the library ---- */

constexpr LacunaComponentFunctions component = [] {
    LacunaComponentFunctions table{};
    table.size = sizeof table;
    table.schema = schema;
    table.create = create;
    table.destroy = destroy;
    return table;
}();

constexpr LacunaReaderFunctions reader = [] {
    LacunaReaderFunctions table{};
    table.size = sizeof table;
    table.recognises = recognises;
    table.inspect = inspect;
    table.names_files = names_files;
    table.files = files;
    table.measurements = measurements;
    table.response = response;
    return table;
}();

const LacunaEntry entries[] = {LACUNA_ENTRY("reader", "skeleton", component, reader)};

} // namespace

LACUNA_DECLARE("skeleton", "1.0.0", LACUNA_PROVIDES("reader", "skeleton"), entries);

//! The C header, written from the declarations of [`super::table`].

use std::fmt::Write as _;

use crate::status;
use crate::table::{Field, MAGIC, MAJOR, MINOR, Shape, Type, shapes};

/// The header `lacuna_plugin.h`.
pub fn header() -> String {
    let mut text = String::from(BEGIN);
    let _ = write!(
        text,
        "#define LACUNA_MAGIC UINT64_C(0x{MAGIC:x})\n#define LACUNA_MAJOR {MAJOR}u\n#define LACUNA_MINOR {MINOR}u\n\n\
         /* What a function returns. */\nenum {{\n"
    );
    for (name, value, meaning) in status::ALL {
        let _ = writeln!(text, "    /* {meaning} */\n    LACUNA_{name} = {value},");
    }
    text.push_str("    LACUNA_STATUS_END\n};\n\n");
    for shape in shapes() {
        structure(&shape, &mut text);
    }
    let _ = write!(
        text,
        "#define LACUNA_RECORD_BEGIN \"lacuna-plugin-record:{MAJOR}.{MINOR}\\n\"\n\n{END}"
    );
    for helpers in HELPERS {
        text.push_str(helpers);
        text.push('\n');
    }
    for end in [CLOSE, IN_CPP, END_OF_FILE] {
        text.push_str(end);
    }
    text
}

const BEGIN: &str = r#"/* Plugins for Lacuna in C.
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

"#;

const END: &str = r#"/* A text from a string literal. */
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

"#;

/// Functions in C for the authors of plugins, in this order: those of a file use those of the files before.
const HELPERS: [&str; 3] =
    [include_str!("header/json.h"), include_str!("header/say.h"), include_str!("header/random.h")];

const CLOSE: &str = r"#ifdef __cplusplus
}
#endif

";

/// Functions for the authors of plugins in C++.
const IN_CPP: &str = include_str!("header/cpp.h");

const END_OF_FILE: &str = "\n#endif\n";

/// The longest line of a comment.
const WIDTH: usize = 116;

fn structure(shape: &Shape, text: &mut String) {
    comment(shape.docs, "", text);
    let _ = writeln!(text, "typedef struct Lacuna{} {{", shape.name);
    for field in shape.fields {
        comment(field.docs, "    ", text);
        member(field, text);
    }
    let _ = writeln!(text, "}} Lacuna{};\n", shape.name);
}

/// The lines of a comment, filled anew.
fn comment(docs: &[&str], indent: &str, text: &mut String) {
    let mut line = format!("{indent}/*");
    for word in docs.iter().flat_map(|doc| doc.split_whitespace()) {
        if line.chars().count() + 1 + word.chars().count() > WIDTH {
            let _ = writeln!(text, "{line}");
            line = format!("{indent} *");
        }
        line.push(' ');
        line.push_str(word);
    }
    let _ = writeln!(text, "{line} */");
}

fn member(field: &Field, text: &mut String) {
    let name = field.name;
    let _ = match field.of {
        Type::Function { optional, arguments, returns } => {
            let arguments = arguments.iter().map(|(name, of)| declared(of, name)).collect();
            let may = if optional { "    /* May be null. */\n" } else { "" };
            writeln!(text, "{may}    {};", function(name, arguments, returns))
        }
        Type::Value(of) => match signature(of) {
            Some((arguments, returns)) => {
                writeln!(text, "    {};", function(name, arguments, returns))
            }
            None => writeln!(text, "    {};", declared(of, name)),
        },
    };
}

/// A pointer to a function.
fn function(name: &str, arguments: Vec<String>, returns: &str) -> String {
    let returns = if returns.is_empty() { "void".to_owned() } else { base(returns) };
    let arguments = if arguments.is_empty() { "void".to_owned() } else { arguments.join(", ") };
    format!("{returns} (*{name})({arguments})")
}

/// Arguments and result of a pointer to a function, as Rust writes it.
fn signature(of: &str) -> Option<(Vec<String>, &str)> {
    let inside = of.split_once("fn(")?.1.trim_end_matches('>');
    let (arguments, returns) = inside.split_once(')')?;
    let one = |argument: &str| {
        let (name, of) = argument.split_once(':')?;
        Some(declared(of.trim(), name.trim()))
    };
    let arguments = arguments.split(',').filter_map(one).collect();
    Some((arguments, returns.trim().trim_start_matches("->").trim()))
}

/// A variable of a type, as C declares it.
fn declared(of: &str, name: &str) -> String {
    if let Some(inner) = of.strip_prefix('[') {
        let (element, count) = inner.trim_end_matches(']').split_once(';').unwrap_or((inner, "1"));
        return format!("{} {name}[{}]", base(element.trim()), count.trim());
    }
    if let Some(inner) = of.strip_prefix("*const ") {
        return format!("const {}", declared(inner, &format!("*{name}")));
    }
    if let Some(inner) = of.strip_prefix("*mut ") {
        return declared(inner, &format!("*{name}"));
    }
    format!("{} {name}", base(of))
}

/// A type that is no pointer.
fn base(of: &str) -> String {
    let name = match of {
        "usize" => "size_t",
        "f64" => "double",
        "u8" => "uint8_t",
        "u32" => "uint32_t",
        "u64" => "uint64_t",
        "i32" => "int32_t",
        "c_void" => "void",
        structure => return format!("Lacuna{structure}"),
    };
    name.to_owned()
}

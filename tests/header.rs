//! Functions of the C header for authors of plugins: they compile without a warning where they are unused, and give what
//! lists of cases say (`header/helpers.c`); the skeletons read JSON by them, however it is written (`header/spaced.c`).

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::compiled::{KINDS, STRICT, has, told};
use crate::quick::root;

/// Beginnings of command lines that compile a file in C, also as C++.
const COMPILERS: [&[&str]; 2] = [&["cc", "-std=c99"], &["c++", "-std=c++17", "-x", "c++"]];

/// Find what is read beyond a text, and what the language does not define.
const SANITIZED: [&str; 3] = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

/// A command that compiles sources to `program` with the header at hand.
fn compile(compiler: &[&str], flags: &[&str], sources: &[&Path], program: &Path) -> Command {
    let mut command = Command::new(compiler[0]);
    command.args(&compiler[1..]).args(STRICT).args(flags).arg("-I").arg(root().join("sdk/include"));
    command.args(sources).arg("-o").arg(program).arg("-lm");
    command
}

#[test]
fn the_functions_of_the_header_give_what_lists_of_cases_say() {
    let folder = tempfile::tempdir().unwrap();
    let empty = folder.path().join("empty.c");
    fs::write(&empty, "#include \"lacuna_plugin.h\"\nint main(void) { return 0; }\n").unwrap();
    for compiler in COMPILERS {
        if !has(compiler[0]) {
            continue;
        }
        let program = folder.path().join(compiler[0]);
        told(&mut compile(compiler, &[], &[&empty], &program), 0);
        // A compiler may know the flags and have no library for them.
        let built = compile(compiler, &SANITIZED, &[&empty], &program).output().unwrap();
        let sanitizes = built.status.success()
            && Command::new(&program).status().is_ok_and(|status| status.success());
        let flags: &[&str] = if sanitizes { &SANITIZED } else { &[] };
        let cases = root().join("tests/header/helpers.c");
        told(&mut compile(compiler, flags, &[&cases], &program), 0);
        assert_eq!(told(&mut Command::new(&program), 0), "0 failures\n");
    }
}

/// Kinds whose skeletons in C++ are tested: those that read the most. It takes long to compile them.
const IN_CPP: [&str; 3] = ["effect", "model", "reader"];

#[test]
fn the_skeletons_read_json_of_any_order_and_spacing() {
    let folder = tempfile::tempdir().unwrap();
    let spaced = &root().join("tests/header/spaced.c");
    std::thread::scope(|scope| {
        for (compiler, language) in COMPILERS.into_iter().zip(["c", "cpp"]) {
            let there = has(compiler[0]);
            let asked = |kind| there && (language == "c" || IN_CPP.contains(&kind));
            for kind in KINDS.map(|(kind, ..)| kind).into_iter().filter(|kind| asked(kind)) {
                let skeleton = root().join(format!("cli/src/new/{language}/{kind}.{language}"));
                let program = folder.path().join(format!("{kind}_{language}"));
                scope.spawn(move || {
                    told(&mut compile(compiler, &[], &[spaced, &skeleton], &program), 0);
                    assert_eq!(told(&mut Command::new(&program), 0), "0 failures\n", "{kind}");
                });
            }
        }
    });
}

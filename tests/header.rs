//! Functions of the C header for authors of plugins: they compile without a warning where they are unused, and give what
//! lists of cases say (`header/helpers.c`).

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::compiled::{STRICT, has, told};
use crate::quick::root;

/// Beginnings of command lines that compile a file in C, also as C++.
const COMPILERS: [&[&str]; 2] = [&["cc", "-std=c99"], &["c++", "-std=c++17", "-x", "c++"]];

/// Find what is read beyond a text, and what the language does not define.
const SANITIZED: [&str; 3] = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

/// A command that compiles a source to `program` with the header at hand.
fn compile(compiler: &[&str], flags: &[&str], source: &Path, program: &Path) -> Command {
    let mut command = Command::new(compiler[0]);
    command.args(&compiler[1..]).args(STRICT).args(flags);
    command.arg("-I").arg(root().join("sdk/include")).arg(source).arg("-o").arg(program).arg("-lm");
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
        told(&mut compile(compiler, &[], &empty, &program), 0);
        // A compiler may know the flags and have no library for them.
        let built = compile(compiler, &SANITIZED, &empty, &program).output().unwrap();
        let sanitizes = built.status.success()
            && Command::new(&program).status().is_ok_and(|status| status.success());
        let flags: &[&str] = if sanitizes { &SANITIZED } else { &[] };
        let cases = root().join("tests/header/helpers.c");
        told(&mut compile(compiler, flags, &cases, &program), 0);
        assert_eq!(told(&mut Command::new(&program), 0), "0 failures\n");
    }
}

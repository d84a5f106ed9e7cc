//! The shell script of a task: the user's lines around `lacuna work`, and the exit code on disk whatever happens.

use std::path::Path;

/// What a script is made of.
#[derive(Debug, Clone, Copy)]
pub struct Script<'a> {
    /// Lines for the scheduler, after the first.
    pub directives: &'a [String],
    /// The user's lines, before the worker.
    pub setup: &'a [String],
    /// The program.
    pub program: &'a Path,
    /// The folder of the submission, from the root.
    pub folder: &'a Path,
    /// The variable that holds the number of the task.
    pub task: &'a str,
    /// Whether the script itself keeps what is printed, as `taskN.txt`.
    pub log: bool,
    /// How many runs of the task are made at a time.
    pub parallel: usize,
}

impl Script<'_> {
    /// The script as text.
    pub fn text(&self) -> String {
        let mut text = String::from("#!/bin/bash\n");
        for line in self.directives {
            text.push_str(&format!("{line}\n"));
        }
        let (folder, task) = (quoted(self.folder), self.task);
        // Written under another name and renamed, so that a file that is there is whole.
        text.push_str(&format!(
            "\nfolder={folder}\ntask=${{{task}}}\n\
             note() {{ printf '%s\\n' \"$1\" > \"$folder/task$task.exit.part\" && \
             mv \"$folder/task$task.exit.part\" \"$folder/task$task.exit\"; }}\n\
             trap 'note $?' EXIT\n\n"
        ));
        if self.log {
            text.push_str("exec > \"$folder/task$task.txt\" 2>&1\n");
        }
        for line in self.setup {
            text.push_str(&format!("{line}\n"));
        }
        text.push_str(&format!(
            "{} work \"$folder\" --task \"$task\" --parallel {}\n",
            quoted(self.program),
            self.parallel
        ));
        text
    }
}

/// The exit code that a task left behind.
pub fn exit_code(folder: &Path, task: usize) -> Option<i32> {
    let text = std::fs::read_to_string(folder.join(format!("task{task}.exit"))).ok()?;
    text.trim().parse().ok()
}

/// A path as one word of a shell.
pub fn quoted(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', "'\\''"))
}

/// The directives for environment modules.
pub fn module_lines(modules: &[String]) -> Vec<String> {
    modules.iter().map(|module| format!("module load {module}")).collect()
}

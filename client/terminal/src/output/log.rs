//! A file with everything that a command says, also what its terminal does not show.

use std::fs::File;
use std::io::{Result, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

static LOG: Mutex<Option<File>> = Mutex::new(None);

/// Keeps what is said from now on in a new file at `path`. The file may be moved while it is written.
///
/// # Errors
/// When the file can't be written.
pub fn start(path: &Path) -> Result<()> {
    let file = File::create(path)?;
    *LOG.lock().unwrap_or_else(PoisonError::into_inner) = Some(file);
    Ok(())
}

/// Writes a line to the log, if there is one.
pub(super) fn keep(text: &str) {
    let mut log = LOG.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(file) = &mut *log {
        // The command's work does not depend on its log.
        let _ = writeln!(file, "{text}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::passing;

    #[test]
    fn a_log_has_notes_details_and_results_but_no_progress() {
        let folder = tempfile::tempdir().expect("a folder");
        let [first, moved] = ["first.txt", "moved.txt"].map(|name| folder.path().join(name));
        crate::tell!("before the log");
        start(&first).expect("a log");
        crate::tell!("a note");
        crate::detail!("a detail \u{1b}[2J");
        std::fs::rename(&first, &moved).expect("moved");
        crate::say!("a result");
        passing(format_args!("half of it"));
        let kept = std::fs::read_to_string(&moved).expect("a log");
        assert_eq!(kept, "a note\na detail \\u{1b}[2J\na result\n");
    }
}

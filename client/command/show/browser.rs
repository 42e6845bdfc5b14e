//! Pages that a command has made.

use std::path::Path;

/// Opens `page` in the user's browser. Without a browser, prints a note: the page is written in any
/// case.
pub(crate) fn in_browser(page: &Path) {
    if let Err(error) = open::that(page) {
        tell!(
            "note: no browser opens here ({error}): open {} yourself",
            page.display()
        );
    }
}

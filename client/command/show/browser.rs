//! Pages that a command has made.

use std::path::Path;

/// Opens `page` in the user's browser. Where there is none, a note says so: the page is there all
/// the same.
pub(crate) fn in_browser(page: &Path) {
    if let Err(error) = open::that(page) {
        tell!(
            "note: no browser opens here ({error}): open {} yourself",
            page.display()
        );
    }
}

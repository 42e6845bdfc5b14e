//! Pages that a command has made.

use std::ffi::OsStr;

/// Opens `page`, a file or an address, in the user's browser. Without a browser, prints a note: the page is there in any
/// case.
pub(crate) fn in_browser(page: impl AsRef<OsStr>) {
    let page = page.as_ref();
    if let Err(error) = open::that(page) {
        tell!(
            "note: no browser opens here ({error}): open {} yourself",
            page.display()
        );
    }
}

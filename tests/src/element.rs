//! The element `<yoto-avatar>` in a page of another site.

use crate::browser::Browser;
use anyhow::ensure;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;
use serde_json::json;

const PAGE: &str = include_str!("element.html");

/// What the scripts of [`PAGE`] leave.
#[derive(Deserialize)]
struct ElementFaults {
    /// What the element does wrong, in words.
    faults: Vec<String>,
}

/// Tries what the element promises with the person of an exported `page`.
///
/// # Errors
/// When the browser fails, or the element does something else.
pub fn tried(browser: &Browser, page: &str) -> anyhow::Result<()> {
    let address = json!(format!("data:text/html;base64,{}", STANDARD.encode(page)));
    let constant = format!("const PAGE = {address};\n// The page is not");
    let page = PAGE.replacen("// The page is not", &constant, 1).replacen(
        "{{element}}",
        &yoto_player::ELEMENT,
        1,
    );
    let ElementFaults { faults } = browser.found(&page)?;
    ensure!(faults.is_empty(), "<yoto-avatar>: {}", faults.join("; "));
    Ok(())
}

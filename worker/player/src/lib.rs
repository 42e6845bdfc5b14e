//! What plays an exported person in a browser, by WebGL2: a page that needs no network, and a web component for pages of
//! others.
//!
//! The shaders (`*.glsl`) compute the same as `yoto_ops`'s splat operation. `player.js` poses the bones, sorts the splats and
//! draws; `controls.js` are the buttons of the page, and `component.js` is the element.

use std::sync::LazyLock;

const PAGE: &str = include_str!("page.html");
const CONTROLS: &str = include_str!("controls.js");
const COMPONENT: &str = include_str!("component.js");

/// The shaders, and the player that uses them.
static PLAYER: LazyLock<String> = LazyLock::new(|| {
    let (vertex, fragment) = (include_str!("vertex.glsl"), include_str!("fragment.glsl"));
    let player = include_str!("player.js");
    format!(
        "const shaders = {{ vertex: `{}`, fragment: `{}` }};\n{player}",
        vertex.trim(),
        fragment.trim()
    )
});

/// The script of the element `<yoto-avatar src="PAGE">`, which plays the person of a page that [`page`] has made.
pub static ELEMENT: LazyLock<String> = LazyLock::new(|| scope(COMPONENT));

/// The script of a page.
static SCRIPT: LazyLock<String> = LazyLock::new(|| scope(CONTROLS));

/// The player with the script `what` that uses it, in one scope of their own.
fn scope(what: &str) -> String {
    format!("(() => {{\n\"use strict\";\n{}{what}}})();\n", *PLAYER)
}

/// The page called `title` that plays the person in `data`, JSON as `yoto-export` writes it.
pub fn page(title: &str, data: &str) -> String {
    // A `</script>` in a name would end the script. JSON has `<` in strings alone.
    let data = data.replace('<', "\\u003c");
    PAGE.replace("{{title}}", &escaped(title))
        .replace("{{player}}", &SCRIPT)
        .replace("{{person}}", &data)
}

/// `text` without characters that have a meaning in HTML or in a page template of `{name}` fields.
pub fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            // Otherwise a title could contain one of the page's placeholders.
            '{' => escaped.push_str("&#123;"),
            other => escaped.push(other),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Most bytes of the element's script.
    const ELEMENT_BYTES: usize = 40_000;

    #[test]
    fn the_element_is_one_small_file_that_loads_nothing_by_itself() {
        assert!(ELEMENT.len() <= ELEMENT_BYTES, "{} bytes", ELEMENT.len());
        for other in [
            "import ",
            "import(",
            "http:",
            "https:",
            "</script",
            "innerHTML",
            "eval(",
        ] {
            assert!(!ELEMENT.contains(other), "{other}");
        }
        // A backtick would end the string that has a shader.
        assert_eq!(
            PLAYER
                .split("function createPlayer")
                .next()
                .unwrap_or_default()
                .matches('`')
                .count(),
            4
        );
    }

    #[test]
    fn a_name_in_the_data_ends_no_script_and_a_title_is_no_markup() {
        let page = page("<b>{{person}}", r#"{"name": "</script>"}"#);
        assert_eq!(page.matches("</script>").count(), 2);
        assert!(
            page.contains("<title>&lt;b&gt;&#123;&#123;person}}</title>"),
            "{page}"
        );
        assert!(page.contains(r#"{"name": "\u003c/script>"}"#));
    }
}

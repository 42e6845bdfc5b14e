//! Makes untrusted text safe to print, by escaping its hidden characters.
//!
//! A terminal executes the escape sequences in its output: one of them writes to the clipboard. Bidirectional controls
//! can make a file name look like another one.

use std::borrow::Cow;
use std::fmt::Write;

/// Maximum length of one line from untrusted text, characters: about twelve rows of a terminal.
pub const LINE_CHARACTERS: usize = 1000;

/// Whether `character` is invisible and can change how the text around it is shown: control characters, bidirectional
/// controls, line and paragraph separators, tags, and zero-width characters. The zero-width joiner and non-joiner
/// (U+200D, U+200C) do not count: emoji and several scripts need them.
pub fn is_hidden(character: char) -> bool {
    character.is_control()
        || matches!(
            character,
            '\u{61c}'
                | '\u{180e}'
                | '\u{200b}'
                | '\u{200e}'..='\u{200f}'
                | '\u{2028}'..='\u{202e}'
                | '\u{2060}'..='\u{206f}'
                | '\u{feff}'
                | '\u{fff9}'..='\u{fffb}'
                | '\u{e0000}'..='\u{e007f}'
        )
}

/// `text` with each hidden character escaped, such as `\u{1b}`. Line feeds and tabs are kept.
pub fn visible(text: &str) -> Cow<'_, str> {
    let stays = |it: char| matches!(it, '\n' | '\t') || !is_hidden(it);
    if text.chars().all(stays) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(escaped(text.chars(), stays))
}

/// `text` as one line of at most `characters` characters. Line breaks and tabs become spaces; other hidden characters
/// are escaped.
pub fn one_line(text: &str, characters: usize) -> String {
    let text = text.trim();
    let broken = |it: char| matches!(it, '\n' | '\r' | '\t');
    let shown = text.chars().map(|it| if broken(it) { ' ' } else { it });
    let mut line = escaped(shown.take(characters.saturating_add(1)), |it| {
        !is_hidden(it)
    });
    if let Some((end, _)) = line.char_indices().nth(characters) {
        let cut = line.char_indices().nth(characters.saturating_sub(1));
        line.truncate(cut.map_or(end, |(at, _)| at));
        line.push('…');
    }
    line
}

fn escaped(text: impl Iterator<Item = char>, stays: impl Fn(char) -> bool) -> String {
    let mut out = String::new();
    for character in text {
        if stays(character) {
            out.push(character);
        } else {
            // Writing to a String can't fail.
            let _ = write!(out, "\\u{{{:x}}}", u32::from(character));
        }
    }
    out
}

/// `1 frame`, `2 frames`: a number with a noun whose plural ends in s.
pub fn count(number: usize, noun: &str) -> String {
    match number {
        1 => format!("1 {noun}"),
        _ => format!("{number} {noun}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_characters_are_escaped() {
        let clipboard = "\u{1b}]52;c;aGk=\u{7}";
        assert_eq!(visible(clipboard), "\\u{1b}]52;c;aGk=\\u{7}");
        assert_eq!(visible("gpj.\u{202e}exe"), "gpj.\\u{202e}exe");
        assert_eq!(visible("\u{9b}2J"), "\\u{9b}2J");
        assert_eq!(visible("a\r\u{200b}b"), "a\\u{d}\\u{200b}b");
    }

    #[test]
    fn visible_text_is_kept() {
        for text in [
            "größe 身長",
            "a\n\tb",
            "👩\u{200d}🚀",
            "می\u{200c}خواهم",
            "",
        ] {
            assert!(matches!(visible(text), Cow::Borrowed(it) if it == text));
        }
    }

    #[test]
    fn a_line_is_short_and_has_no_breaks() {
        assert_eq!(one_line(" a\nb\r\nc ", 80), "a b  c");
        assert_eq!(one_line("abcdef", 6), "abcdef");
        assert_eq!(one_line("abcdefg", 6), "abcde…");
        assert_eq!(one_line("a\u{1b}b", 80), "a\\u{1b}b");
        assert_eq!(one_line(&"\u{1b}".repeat(9000), 6), "\\u{1b…");
    }
}

//! Protocol 0, the default of Python 2: numbers and strings as lines of text.

use super::PickleError;
use super::machine::{Machine, Node};

impl Machine<'_> {
    /// A number or a string (I, L, F, S, V) on a line.
    pub(super) fn literal(&mut self, instruction: u8) -> Result<(), PickleError> {
        let line = self.line()?;
        match instruction {
            b'S' => {
                let bytes = unquoted(line)?;
                self.old_string(&bytes)
            }
            b'V' => self.push(Node::Text(unicode(line).into())),
            _ => {
                let text = String::from_utf8_lossy(line);
                let number = text.trim().trim_end_matches('L').parse::<f64>();
                let number = number.map_err(|_| PickleError::Malformed("an invalid number"))?;
                self.push(Node::Number(number))
            }
        }
    }

    /// A key of the memo, in digits.
    pub(super) fn memo_key(&mut self) -> Result<u32, PickleError> {
        let line = String::from_utf8_lossy(self.line()?);
        line.trim()
            .parse()
            .map_err(|_| PickleError::Malformed("a memo without a number"))
    }
}

/// The bytes of a quoted string, as written by Python 2's `repr`.
fn unquoted(line: &[u8]) -> Result<Vec<u8>, PickleError> {
    const BAD: PickleError = PickleError::Malformed("a string without its quotes");
    let line = line.trim_ascii();
    let (Some(first @ (b'\'' | b'"')), Some(last)) = (line.first(), line.last()) else {
        return Err(BAD);
    };
    if first != last || line.len() < 2 {
        return Err(BAD);
    }
    let mut bytes = Vec::with_capacity(line.len());
    let mut rest = line.get(1..line.len() - 1).unwrap_or_default();
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        if byte != b'\\' {
            bytes.push(byte);
            continue;
        }
        let (&escape, after) = rest.split_first().ok_or(BAD)?;
        rest = after;
        match escape {
            b'n' => bytes.push(b'\n'),
            b'r' => bytes.push(b'\r'),
            b't' => bytes.push(b'\t'),
            b'x' => {
                let (digits, after) = rest.split_at_checked(2).ok_or(BAD)?;
                rest = after;
                let digits = str::from_utf8(digits).map_err(|_| BAD)?;
                bytes.push(u8::from_str_radix(digits, 16).map_err(|_| BAD)?);
            }
            other => bytes.push(other),
        }
    }
    Ok(bytes)
}

/// Text with `\uXXXX` for characters beyond Latin-1, backslashes and line ends.
fn unicode(line: &[u8]) -> String {
    let latin: String = line.iter().map(|byte| char::from(*byte)).collect();
    let mut text = String::with_capacity(latin.len());
    let mut rest = latin.as_str();
    while let Some(at) = rest.find("\\u") {
        let (before, escape) = rest.split_at(at);
        text.push_str(before);
        let letter = escape
            .get(2..6)
            .and_then(|digits| u32::from_str_radix(digits, 16).ok())
            .and_then(char::from_u32);
        match letter {
            Some(letter) => {
                text.push(letter);
                rest = escape.get(6..).unwrap_or_default();
            }
            None => {
                text.push_str("\\u");
                rest = escape.get(2..).unwrap_or_default();
            }
        }
    }
    text + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_lose_quotes_and_escapes() {
        assert_eq!(unquoted(br"'a\x00\n\'\\b'"), Ok(b"a\0\n'\\b".to_vec()));
        assert_eq!(unquoted(b"\"it's\""), Ok(b"it's".to_vec()));
        for bad in [br"'a".as_slice(), b"", b"'", br"'\x0'", br"a"] {
            assert!(unquoted(bad).is_err(), "{bad:?}");
        }
        assert_eq!(
            unicode(b"caf\xe9 \\u20ac \\u12"),
            "caf\u{e9} \u{20ac} \\u12"
        );
    }
}

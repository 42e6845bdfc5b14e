//! JSON as plain data.

use yoto_formats::Value;

/// Names that Python writes for numbers which JSON does not have.
const NOT_NUMBERS: [&str; 4] = ["-Infinity", "Infinity", "NaN", "nan"];

/// The data in `bytes`. Numbers that are not finite, as Python writes them, and a `null` among numbers become NaN.
pub(super) fn read(bytes: &[u8]) -> Result<Value, String> {
    // Some editors begin a file with a byte-order mark.
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let json = serde_json::from_slice(bytes).or_else(|error| {
        let text = std::str::from_utf8(bytes).map_err(|_| error.to_string())?;
        let plain = without_not_numbers(text).ok_or_else(|| error.to_string())?;
        serde_json::from_str(&plain).map_err(|_| error.to_string())
    });
    json.map(value)
}

/// `text` with `null` for each number that is not finite; `None` without any.
fn without_not_numbers(text: &str) -> Option<String> {
    let mut plain = String::with_capacity(text.len());
    let (mut rest, mut found) = (text, false);
    let mut is_text = false;
    while let Some(letter) = rest.chars().next() {
        let name = NOT_NUMBERS.iter().find(|name| rest.starts_with(**name));
        if let (false, Some(name)) = (is_text, name) {
            plain.push_str("null");
            rest = &rest[name.len()..];
            found = true;
            continue;
        }
        let mut length = letter.len_utf8();
        if letter == '\\' {
            length += rest[1..].chars().next().map_or(0, char::len_utf8);
        } else if letter == '"' {
            is_text = !is_text;
        }
        plain.push_str(&rest[..length]);
        rest = &rest[length..];
    }
    found.then_some(plain)
}

fn value(json: serde_json::Value) -> Value {
    use serde_json::Value as Json;
    match json {
        Json::Null => Value::Nothing,
        Json::Bool(flag) => Value::Number(f64::from(u8::from(flag))),
        Json::Number(number) => number.as_f64().map_or(Value::Nothing, Value::Number),
        Json::String(text) => Value::Text(text),
        Json::Array(items) => {
            let among_numbers = items.iter().any(Json::is_number);
            let item = |item: Json| match item {
                Json::Null if among_numbers => Value::Number(f64::NAN),
                item => value(item),
            };
            Value::List(items.into_iter().map(item).collect())
        }
        Json::Object(entries) => {
            let entry = |(key, item)| (Value::Text(key), value(item));
            Value::Dict(entries.into_iter().map(entry).collect())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_not_finite_are_read_as_python_writes_them() {
        let value = read(br#"{"a \"NaN": [1, NaN, -Infinity, null], "b": NaN, "c": [null]}"#);
        let value = value.expect("reads");
        let numbers = value
            .get("a \"NaN")
            .and_then(Value::numbers)
            .expect("numbers");
        assert_eq!(numbers.values[0], 1.0);
        assert!(numbers.values[1..].iter().all(|it| it.is_nan()));
        assert_eq!(value.get("b"), Some(&Value::Nothing));
        assert_eq!(value.get("c"), Some(&Value::List(vec![Value::Nothing])));
        assert_eq!(
            read("\u{feff}[2]".as_bytes()),
            Ok(Value::List(vec![Value::Number(2.0)]))
        );
        assert!(read(b"[1, NaM]").is_err() && read(b"[\xff, NaN]").is_err());
    }
}

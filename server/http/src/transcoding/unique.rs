//! JSON whose objects have no field twice. Readers differ in which of two they take, so what one of them has checked is not what the other
//! carries out (RFC 8259, 4).

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::collections::HashSet;
use std::fmt;

/// A value whose objects have each field once. A field of the contract has two spellings, `display_name` and `displayName`: they are one
/// field.
pub(super) struct Unique(pub Value);

impl<'de> Deserialize<'de> for Unique {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(UniqueVisitor)
    }
}

/// The name in JSON of a field that the contract calls `name`.
fn camel_case(name: &str) -> String {
    let mut words = name.split('_');
    let first = words.next().unwrap_or_default().to_owned();
    words.fold(first, |mut all, word| {
        let mut letters = word.chars();
        all.extend(letters.next().map(|it| it.to_ascii_uppercase()));
        all + letters.as_str()
    })
}

struct UniqueVisitor;

impl<'de> Visitor<'de> for UniqueVisitor {
    type Value = Unique;

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("JSON")
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Unique, E> {
        Ok(Unique(value.into()))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Unique, E> {
        Ok(Unique(value.into()))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Unique, E> {
        Ok(Unique(value.into()))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Unique, E> {
        Ok(Unique(
            Number::from_f64(value).map_or(Value::Null, Value::Number),
        ))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Unique, E> {
        Ok(Unique(value.into()))
    }

    fn visit_string<E: Error>(self, value: String) -> Result<Unique, E> {
        Ok(Unique(value.into()))
    }

    fn visit_unit<E: Error>(self) -> Result<Unique, E> {
        Ok(Unique(Value::Null))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut values: A) -> Result<Unique, A::Error> {
        let mut found = Vec::new();
        while let Some(Unique(value)) = values.next_element()? {
            found.push(value);
        }
        Ok(Unique(Value::Array(found)))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<Unique, A::Error> {
        let (mut found, mut names) = (Map::new(), HashSet::new());
        while let Some(name) = fields.next_key::<String>()? {
            if !names.insert(camel_case(&name)) {
                return Err(A::Error::custom(format!("the field '{name}' comes twice")));
            }
            let Unique(value) = fields.next_value()?;
            found.insert(name, value);
        }
        Ok(Unique(Value::Object(found)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Value, String> {
        let read = serde_json::from_str::<Unique>(text);
        read.map(|it| it.0).map_err(|error| error.to_string())
    }

    #[test]
    fn values_are_as_they_are_written() {
        let text =
            r#"{"a":[1,-2,0.5,"x",null,true],"b":{"a":{"a":"\u00fc"}},"big":18446744073709551615}"#;
        let plain: Value = serde_json::from_str(text).expect("JSON");
        assert_eq!(read(text), Ok(plain));
    }

    #[test]
    fn a_field_that_comes_twice_is_named() {
        for (text, name) in [
            (r#"{"a":1,"a":2}"#, "'a'"),
            (r#"{"spec":[{"view":1,"b":2,"view":1}]}"#, "'view'"),
            (
                r#"{"display_name":"Ada","displayName":"Eve"}"#,
                "'displayName'",
            ),
            (
                r#"{"displayName":"Ada","display_name":"Eve"}"#,
                "'display_name'",
            ),
        ] {
            let error = read(text).expect_err(text);
            assert!(
                error.contains(name) && error.contains("comes twice"),
                "{error}"
            );
        }
    }
}

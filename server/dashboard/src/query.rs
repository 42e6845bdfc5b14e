//! Fields of a query or of a form.

use std::collections::HashMap;
use url::form_urlencoded;

/// Fields by their names; of two with one name, the first.
#[derive(Debug, Default)]
pub struct Fields(HashMap<String, String>);

impl Fields {
    /// Reads `name=value&…`, percent-encoded.
    pub fn read(text: &[u8]) -> Self {
        let mut fields = HashMap::new();
        for (name, value) in form_urlencoded::parse(text) {
            fields
                .entry(name.into_owned())
                .or_insert_with(|| value.into_owned());
        }
        Self(fields)
    }

    /// The fields of a query.
    pub fn of_query(query: Option<String>) -> Self {
        Self::read(query.unwrap_or_default().as_bytes())
    }

    /// The field's value; empty if it is absent.
    pub fn get(&self, name: &str) -> &str {
        self.0.get(name).map_or("", String::as_str)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_decoded_and_the_first_one_counts() {
        let fields = Fields::read(b"a=x+y%3C&b=&a=z&%FF=%FF");
        assert_eq!(fields.get("a"), "x y<");
        assert_eq!(fields.get("b"), "");
        assert_eq!(fields.get("c"), "");
    }
}

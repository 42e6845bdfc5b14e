//! Which tenant and scopes somebody has, by the claims of an ID token.

use crate::config::{Grant, OidcConfig};
use serde_json::{Map, Value};

/// The claims of an ID token whose signature and validity were checked.
pub(super) type Claims = Map<String, Value>;

/// The first grant that fits.
pub(super) fn of<'a>(config: &'a OidcConfig, claims: &Claims) -> Option<&'a Grant> {
    config.grants.iter().find(|it| fits(it, claims))
}

fn fits(grant: &Grant, claims: &Claims) -> bool {
    // Whoever registers an address at an issuer may not own it.
    let verified = grant.claim != "email" || is_verified(claims);
    verified
        && match claims.get(&grant.claim) {
            Some(Value::String(text)) => is_like(&grant.value, text),
            Some(Value::Array(all)) => {
                (all.iter().filter_map(Value::as_str)).any(|text| is_like(&grant.value, text))
            }
            _ => false,
        }
}

/// Some issuers have it as text.
fn is_verified(claims: &Claims) -> bool {
    match claims.get("email_verified") {
        Some(Value::Bool(verified)) => *verified,
        Some(Value::String(text)) => text == "true",
        _ => false,
    }
}

/// `*` before the end of an address stands for its user, who has no `@`.
fn is_like(wanted: &str, text: &str) -> bool {
    match wanted.strip_prefix('*') {
        Some("") => !text.is_empty(),
        Some(end) if end.starts_with('@') => {
            let user = text.len().checked_sub(end.len());
            user.filter(|it| *it > 0 && text.is_char_boundary(*it))
                .map(|it| text.split_at(it))
                .is_some_and(|(user, host)| host.eq_ignore_ascii_case(end) && !user.contains('@'))
        }
        _ => wanted == text,
    }
}

/// What people are called in the list of keys.
pub(super) fn name(claims: &Claims) -> &str {
    // An address that nobody has verified may be another's.
    let email = is_verified(claims).then_some("email");
    email
        .into_iter()
        .chain(["preferred_username", "name", "sub"])
        .find_map(|it| claims.get(it)?.as_str())
        .unwrap_or("somebody")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::GrantedScope;
    use serde_json::json;

    fn fitting(claim: &str, value: &str, claims: Value) -> bool {
        let grant = Grant {
            claim: claim.to_owned(),
            value: value.to_owned(),
            tenant: "default".to_owned(),
            scopes: vec![GrantedScope::Read],
        };
        let Value::Object(claims) = claims else {
            panic!("claims are an object");
        };
        fits(&grant, &claims)
    }

    #[test]
    fn an_address_counts_only_once_it_was_verified() {
        let ada = |verified: Value| json!({"email": "ada@example.org", "email_verified": verified});
        for wanted in ["ada@example.org", "*@example.org", "*@EXAMPLE.org", "*"] {
            assert!(fitting("email", wanted, ada(json!(true))), "{wanted}");
            assert!(fitting("email", wanted, ada(json!("true"))), "{wanted}");
            assert!(!fitting("email", wanted, ada(json!(false))), "{wanted}");
            assert!(!fitting(
                "email",
                wanted,
                json!({"email": "ada@example.org"})
            ));
        }
    }

    #[test]
    fn a_domain_is_no_part_of_another_one() {
        let email = |text: &str| json!({"email": text, "email_verified": true});
        for other in [
            "ada@evil.example.org",
            "ada@example.org.evil.net",
            "eve@evil.net@example.org",
            "@example.org",
            "adaexample.org",
            "",
        ] {
            assert!(!fitting("email", "*@example.org", email(other)), "{other}");
        }
        // A star elsewhere is no pattern.
        assert!(!fitting("email", "*.org", email("ada@example.org")));
        assert!(!fitting("email", "*", email("")));
    }

    #[test]
    fn one_of_a_list_is_enough() {
        let groups = json!({"groups": ["staff", "film", 7]});
        assert!(fitting("groups", "film", groups.clone()));
        assert!(!fitting("groups", "fil", groups.clone()));
        assert!(!fitting("sub", "film", groups));
    }

    #[test]
    fn people_have_the_name_that_says_most() {
        let mut all = json!({"sub": "7", "email": "ada@example.org"});
        assert_eq!(name(all.as_object().expect("an object")), "7");
        all["email_verified"] = json!(true);
        assert_eq!(name(all.as_object().expect("an object")), "ada@example.org");
        assert_eq!(name(&Claims::new()), "somebody");
    }
}

//! Settings of an issuer of OpenID Connect.

use super::ConfigError;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use url::Url;
use yoto_proto::v1::Scope;

/// Hours of a session unless the settings say otherwise: a day of work.
const HOURS: f64 = 12.0;
/// Maximum hours of a session: a year.
const MAX_HOURS: f64 = 8760.0;

/// An issuer of OpenID Connect, and what it may vouch for.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OidcConfig {
    /// The issuer's URL, as the issuer itself writes it: it is compared. The issuer's description is at
    /// `/.well-known/openid-configuration` below.
    pub issuer: String,
    /// What the issuer knows this service by.
    pub client_id: String,
    /// A file with the secret that the issuer has given this service; none where it needs none.
    #[serde(default)]
    pub client_secret_file: Option<PathBuf>,
    /// Where browsers reach this service. The issuer must know `/sign-in/back` below as a redirection.
    pub address: Url,
    /// Scopes that are asked of the issuer, such as `groups`, besides `openid`.
    #[serde(default = "scopes")]
    pub request_scopes: Vec<String>,
    /// Hours until a session ends.
    #[serde(default = "hours")]
    pub hours: f64,
    /// Who may sign in, and to what; the first one that fits counts.
    #[serde(rename = "grant", default)]
    pub grants: Vec<Grant>,
}

/// What people with a claim may do.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grant {
    /// A claim of the ID token, such as `email`, `groups` or `sub`.
    pub claim: String,
    /// What it must be, or contain if it is a list. `*` alone fits everybody who has the claim, and `*@example.org` each address
    /// of a domain.
    pub value: String,
    /// The tenant whose member they are.
    pub tenant: String,
    /// What they may do: `read`, `write`, `operate`.
    pub scopes: Vec<GrantedScope>,
}

/// A scope that people can have. Workers have keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GrantedScope {
    /// Look at everything of the tenant.
    Read,
    /// Change it.
    Write,
    /// Keep the service running.
    Operate,
}

impl From<GrantedScope> for Scope {
    fn from(scope: GrantedScope) -> Self {
        match scope {
            GrantedScope::Read => Self::Read,
            GrantedScope::Write => Self::Write,
            GrantedScope::Operate => Self::Operate,
        }
    }
}

fn hours() -> f64 {
    HOURS
}

fn scopes() -> Vec<String> {
    vec!["email".to_owned(), "profile".to_owned()]
}

impl OidcConfig {
    /// The same with its file of a secret relative to `folder`, that of the settings.
    #[must_use]
    pub fn in_folder(mut self, folder: &Path) -> Self {
        self.client_secret_file = self.client_secret_file.map(|it| folder.join(it));
        self
    }

    /// The issuer's name for people.
    pub(crate) fn host(&self) -> String {
        let url = Url::parse(&self.issuer).ok();
        let host = url.as_ref().and_then(Url::host_str);
        host.unwrap_or(&self.issuer).to_owned()
    }

    /// Rejects settings by which nobody could sign in, or by a way that others can listen to.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        let refused = |field: &str, why: &str| Err(ConfigError(format!("oidc: {field} {why}")));
        let issuer = Url::parse(&self.issuer).ok();
        for (field, url) in [
            ("issuer", issuer.as_ref()),
            ("address", Some(&self.address)),
        ] {
            if !url.is_some_and(is_private) {
                return refused(field, "must begin with https://, or lead to this machine");
            }
        }
        if issuer.is_some_and(|it| !it.username().is_empty() || it.password().is_some()) {
            return refused("issuer", "must not have a user name or a password");
        }
        if let Some(path) = &self.client_secret_file {
            let secret = std::fs::read_to_string(path).map_err(|error| {
                ConfigError(format!(
                    "oidc: client_secret_file {}: {error}",
                    path.display()
                ))
            })?;
            if secret.trim().is_empty() {
                return refused("client_secret_file", "is empty");
            }
        }
        if self.client_id.is_empty() {
            return refused("client_id", "is empty");
        }
        if !(self.hours > 0.0 && self.hours <= MAX_HOURS) {
            return refused("hours", "must be above 0 and at most 8760");
        }
        if self.grants.is_empty() {
            return refused("grant", "is missing: nobody could sign in");
        }
        for (number, grant) in (1..).zip(&self.grants) {
            let field = |name: &str| format!("grant {number}: {name}");
            if grant.claim.is_empty() || grant.value.is_empty() {
                return refused(&field("claim and value"), "must not be empty");
            }
            if yoto_store::Tenant::new(&grant.tenant).is_none() {
                return refused(&field("tenant"), "is not 1 to 64 of a-z, 0-9 and -");
            }
            if !grant.scopes.contains(&GrantedScope::Read) {
                return refused(&field("scopes"), "must contain \"read\": pages read");
            }
        }
        Ok(())
    }
}

/// Whether nobody on the way can read what is sent: it is encrypted, or doesn't leave this machine.
fn is_private(url: &Url) -> bool {
    let own = match url.host() {
        Some(url::Host::Domain(name)) => name == "localhost",
        Some(url::Host::Ipv4(ip)) => ip.is_loopback(),
        Some(url::Host::Ipv6(ip)) => ip.is_loopback(),
        None => false,
    };
    url.scheme() == "https" || url.scheme() == "http" && own
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> OidcConfig {
        OidcConfig {
            issuer: "https://id.example.org".to_owned(),
            client_id: "yoto".to_owned(),
            client_secret_file: None,
            address: "http://localhost:50051".parse().expect("a URL"),
            request_scopes: scopes(),
            hours: HOURS,
            grants: vec![Grant {
                claim: "email".to_owned(),
                value: "*@example.org".to_owned(),
                tenant: "default".to_owned(),
                scopes: vec![GrantedScope::Read],
            }],
        }
    }

    #[test]
    fn settings_that_let_nobody_in_are_refused_by_field() {
        assert!(good().check().is_ok());
        let told = |change: fn(&mut OidcConfig)| {
            let mut config = good();
            change(&mut config);
            config.check().expect_err("bad").to_string()
        };
        type Case = (&'static str, fn(&mut OidcConfig));
        let cases: [Case; 9] = [
            ("issuer", |it| {
                it.issuer = "http://id.example.org".to_owned()
            }),
            ("address", |it| {
                it.address = "http://10.0.0.1".parse().expect("a URL")
            }),
            ("issuer must not have a user name", |it| {
                it.issuer = "https://ada:secret@id.example.org".to_owned()
            }),
            ("client_secret_file /nowhere/secret", |it| {
                it.client_secret_file = Some("/nowhere/secret".into())
            }),
            ("client_id", |it| it.client_id.clear()),
            ("hours", |it| it.hours = f64::NAN),
            ("grant is missing", |it| it.grants.clear()),
            ("grant 1: tenant", |it| it.grants[0].tenant = "A".to_owned()),
            ("grant 1: scopes", |it| {
                it.grants[0].scopes = vec![GrantedScope::Write]
            }),
        ];
        for (field, change) in cases {
            let error = told(change);
            assert!(error.contains(field), "{field}: {error}");
        }
    }

    #[test]
    fn a_secret_stands_beside_the_settings() {
        let mut config = good();
        config.client_secret_file = Some("secret".into());
        let config = config.in_folder(Path::new("/etc/yoto"));
        assert_eq!(config.client_secret_file, Some("/etc/yoto/secret".into()));
    }
}

//! Every call over HTTP, for callers without a key, with one of another scope, and with the right one. The description of all
//! requests is walked, so that a new call is covered without being named here.

use crate::support::{SCOPES, Service, ask_with, listen_as};
use crate::tenants::requests::{methods, scope};
use serde_json::Value;
use std::collections::HashMap;
use yoto_proto::v1::Scope;
use yoto_server::Admission;

#[tokio::test]
async fn a_call_over_http_needs_what_the_call_needs() {
    let service = Service::start().await;
    let mut keys = HashMap::new();
    for scope in SCOPES {
        keys.insert(scope, service.key("default", &[scope]).await.text);
    }
    let (address, _serving) = listen_as(&service, Admission::Nobody).await;
    let ask = async |verb: &str, path: &str, key: Option<&String>| {
        let key = key.map_or_else(String::new, |it| format!("Authorization: Bearer {it}\r\n"));
        let (status, head, text) = ask_with(address, verb, path, &key, "").await;
        (status, head + &text)
    };
    let description = "/v1/openapi.json";
    assert_eq!(ask("GET", description, None).await.0, 401);
    let (_, _, text) = ask_with(
        address,
        "GET",
        description,
        &format!("Authorization: Bearer {}\r\n", keys[&Scope::Work]),
        "",
    )
    .await;
    let description: Value = serde_json::from_str(&text).expect("JSON");
    let needed: HashMap<String, Scope> = methods()
        .iter()
        .map(|it| (it.name().to_owned(), scope(it)))
        .collect();
    let (mut cells, mut faults) = (0, Vec::new());
    for (path, item) in description["paths"].as_object().expect("paths") {
        // A name where the path has a hole.
        let parts = path.split('{').map(|it| match it.split_once('}') {
            Some((hole, rest)) if hole == "parent" || hole == "name" => format!("jobs/7{rest}"),
            Some((_, rest)) => format!("7{rest}"),
            None => it.to_owned(),
        });
        let asked: String = parts.collect();
        for (verb, operation) in item.as_object().expect("operations") {
            let verb = verb.to_uppercase();
            let id = operation["operationId"].as_str().expect("an id");
            let needed = needed[id];
            let (status, told) = ask(&verb, &asked, None).await;
            if status != 401 || !told.contains("KEY_MISSING") {
                faults.push(format!("{verb} {asked} without a key: {told}"));
            }
            for (scope, key) in &keys {
                // An endless stream is not read to its end.
                if id == "WatchJobs" && *scope == needed {
                    continue;
                }
                let (status, told) = ask(&verb, &asked, Some(key)).await;
                let through = status != 401 && status != 403;
                if through != (*scope == needed) || (!through && !told.contains("SCOPE_MISSING")) {
                    faults.push(format!("{verb} {asked} with {scope:?}: {told}"));
                }
                cells += 1;
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    let of_users = methods()
        .iter()
        .filter(|it| scope(it) != Scope::Work)
        .count();
    assert_eq!(cells, 4 * of_users - 1);
}

//! The calls over HTTP with JSON: what they carry, whom they answer, and what they refuse.

mod access;
mod files;
mod times;
mod watches;
mod web;

use crate::support::{Service, ask_with, listen};
use serde_json::{Value, json};
use std::net::SocketAddr;

const JSON: &str = "Content-Type: application/json\r\n";

/// Status and JSON of the answer to a call with a body.
async fn send(address: SocketAddr, verb: &str, path: &str, body: &Value) -> (u16, Value) {
    send_with(address, verb, path, "", body).await
}

/// The same with more headers.
async fn send_with(
    address: SocketAddr,
    verb: &str,
    path: &str,
    headers: &str,
    body: &Value,
) -> (u16, Value) {
    let headers = format!("{JSON}{headers}");
    let (status, head, text) = ask_with(address, verb, path, &headers, &body.to_string()).await;
    let value = serde_json::from_str(&text);
    (status, value.unwrap_or_else(|_| panic!("{head}\n{text}")))
}

/// The same for a call whose fields are in the path and the query.
async fn get(address: SocketAddr, path: &str) -> (u16, Value) {
    let (status, head, text) = ask_with(address, "GET", path, "", "").await;
    let value = serde_json::from_str(&text);
    (status, value.unwrap_or_else(|_| panic!("{head}\n{text}")))
}

#[tokio::test]
async fn a_person_is_made_changed_listed_and_deleted() {
    let service = Service::start().await;
    let (address, _serving) = listen(&service).await;
    let ada = json!({ "display_name": "Ada" });
    let (status, made) = send(address, "POST", "/v1/subjects", &ada).await;
    assert_eq!(
        (status, &made["display_name"]),
        (200, &json!("Ada")),
        "{made}"
    );
    assert_eq!(made["state"], "UPLOADING");
    let name = made["name"].as_str().expect("a name").to_owned();
    let path = format!("/v1/{name}");
    let changed = json!({ "display_name": "Ada L." });
    let masked = format!("{path}?update_mask=display_name");
    let (status, changed) = send(address, "PATCH", &masked, &changed).await;
    assert_eq!(
        (status, &changed["display_name"]),
        (200, &json!("Ada L.")),
        "{changed}"
    );
    let (status, listed) = get(address, "/v1/subjects?page_size=5").await;
    assert_eq!(status, 200);
    assert_eq!(listed["subjects"][0]["name"], name);
    let (status, found) = get(address, &path).await;
    assert_eq!((status, &found), (200, &changed));
    // It is the one that gRPC has.
    assert_eq!(service.get_subject(&name).await.display_name, "Ada L.");
    let (status, _) = send(address, "DELETE", &path, &json!(null)).await;
    assert_eq!(status, 400, "a DELETE has no body");
    let (status, _, _) = ask_with(address, "DELETE", &path, "", "").await;
    assert_eq!(status, 200);
    let (status, gone) = get(address, &path).await;
    assert_eq!(status, 404);
    assert_eq!(gone["title"], "NOT_FOUND");
}

#[tokio::test]
async fn a_repeated_idempotency_key_makes_one_person() {
    let service = Service::start().await;
    let (address, _serving) = listen(&service).await;
    let key = "Idempotency-Key: once\r\n";
    let make = async |name: &str| {
        let body = json!({ "display_name": name });
        send_with(address, "POST", "/v1/subjects", key, &body).await
    };
    let (_, first) = make("Ada").await;
    let (status, second) = make("Ada").await;
    assert_eq!((status, &second["name"]), (200, &first["name"]));
    let (status, other) = make("Bob").await;
    assert_eq!(
        (status, &other["title"]),
        (409, &json!("ALREADY_EXISTS")),
        "{other}"
    );
    let (_, listed) = get(address, "/v1/subjects").await;
    assert_eq!(listed["subjects"].as_array().map(Vec::len), Some(1));
}

#[tokio::test]
async fn what_is_wrong_is_told_as_a_problem() {
    let service = Service::start().await;
    let (address, _serving) = listen(&service).await;
    let (status, head, text) = ask_with(address, "GET", "/v1/nothing", "", "").await;
    assert_eq!(status, 404);
    assert!(
        head.contains("content-type: application/problem+json"),
        "{head}"
    );
    assert!(text.contains("/v1/openapi.json"), "{text}");
    let (status, problem) = get(address, "/v1/jobs?colour=red").await;
    assert_eq!(status, 400);
    assert_eq!(problem["fields"][0]["field"], "colour");
    let (status, problem) = get(address, "/v1/jobs/none").await;
    assert_eq!((status, &problem["reason"]), (404, &json!("NOT_FOUND")));
    let unknown = json!({ "display_name": "Ada", "age": 36 });
    let (status, problem) = send(address, "POST", "/v1/subjects", &unknown).await;
    assert_eq!(status, 400);
    let detail = problem["detail"].as_str().expect("a text");
    assert!(detail.contains("age"), "{detail}");
    let long = json!({ "display_name": "x".repeat(1000) });
    let (status, problem) = send(address, "POST", "/v1/subjects", &long).await;
    assert_eq!(
        (status, &problem["fields"][0]["field"]),
        (400, &json!("display_name"))
    );
    let form = "Content-Type: application/x-www-form-urlencoded\r\n";
    let (status, _, text) = ask_with(address, "POST", "/v1/subjects", form, "a=b").await;
    assert!(status == 400 && text.contains("application/json"), "{text}");
}

/// A body that would take gigabytes once it is read.
#[tokio::test]
async fn bodies_are_bounded() {
    let service = Service::start().await;
    let (address, _serving) = listen(&service).await;
    let many = format!("{{\"files\": [{}{{}}]}}", "{},".repeat(700_000));
    let (status, _, text) = ask_with(address, "POST", "/v1/uploads", JSON, &many).await;
    assert!(status == 400 && text.contains("parts"), "{text}");
    let long = format!("{{\"subject\": \"{}\"}}", "x".repeat(5 << 20));
    let (status, _, text) = ask_with(address, "POST", "/v1/uploads", JSON, &long).await;
    assert!(status == 400 && text.contains("longer than"), "{text}");
}

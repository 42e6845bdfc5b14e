//! Times that end something: within the calendar, and ahead.

use super::{get, send};
use crate::support::{Service, assert_invalid, id, listen};
use prost_types::Timestamp;
use serde_json::json;
use yoto_proto::v1::{CreateKeyRequest, Scope};

#[tokio::test]
async fn times_beyond_the_calendar_are_refused_and_stored_ones_do_not_break_lists() {
    let service = Service::start().await;
    let ada = service.subject("Ada").await;
    let (address, _serving) = listen(&service).await;
    let consents = format!("/v1/{}/consents", ada.name);
    let consent =
        |end: &str| json!({ "purposes": ["CONSENT_TRAIN"], "given_by": "Ada", "expire_time": end });
    // A consent that is over is a record.
    let past = "2001-01-01T00:00:00Z";
    let (status, made) = send(address, "POST", &consents, &consent(past)).await;
    assert_eq!(
        (status, &made["expire_time"]),
        (200, &json!(past)),
        "{made}"
    );
    let key =
        |end: &str| json!({ "display_name": "Bob", "scopes": ["SCOPE_READ"], "expire_time": end });
    let (status, refused) = send(address, "POST", "/v1/keys", &key(past)).await;
    assert_eq!(status, 400, "{refused}");
    assert!(refused.to_string().contains("is over already"), "{refused}");
    for beyond in ["1969-12-31T23:59:59Z", "0001-01-01T00:00:00Z"] {
        let answers = [
            send(address, "POST", &consents, &consent(beyond)).await,
            send(address, "POST", "/v1/keys", &key(beyond)).await,
        ];
        for (status, refused) in answers {
            assert_eq!(status, 400, "{refused}");
            assert!(refused.to_string().contains("expire_time"), "{refused}");
        }
    }
    // JSON has no words for these.
    for seconds in [1 << 60, -1, i64::MIN] {
        let request = CreateKeyRequest {
            display_name: "Bob".to_owned(),
            scopes: vec![Scope::Read.into()],
            expire_time: Some(Timestamp { seconds, nanos: 0 }),
            ..CreateKeyRequest::default()
        };
        assert_invalid(service.keys().create_key(request).await, "expire_time");
    }
    // Earlier versions stored any number.
    let row = made["name"].as_str().map(id).expect("a name");
    let far = format!("UPDATE consents SET expire_time = 1e18 WHERE id = '{row}'");
    service.database.run(&far).await;
    let (status, listed) = get(address, &consents).await;
    assert_eq!(status, 200, "{listed}");
    let end = &listed["consents"][0]["expire_time"];
    assert_eq!(end, &json!("9999-12-31T23:59:59Z"), "{listed}");
}

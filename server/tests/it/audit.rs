//! The audit log: every call that changes something, chained.

use crate::support::{Service, ask_with, assert_refused, eventually, id, listen};
use std::sync::Arc;
use std::time::Duration;
use tonic::Code;
use yoto_proto::v1::{
    CreateKeyRequest, CreateSubjectRequest, DeleteSubjectRequest, EraseSubjectRequest,
    GetErasureRequest, ListSubjectsRequest, Scope, Subject, erasure,
};
use yoto_server::clock::ManualClock;
use yoto_server::{AuditEntry, AuditError, AuditHead, AuditLog, Broken, KeyStore};

impl Service {
    async fn log(&self) -> AuditLog {
        let opened = match self.database.url() {
            Some(url) => AuditLog::in_postgres(&url).await,
            None => AuditLog::in_folder(self.dir.path()).await,
        };
        opened.expect("opens")
    }

    /// All entries, once there are `count`.
    async fn entries(&self, count: usize) -> Vec<AuditEntry> {
        let log = self.log().await;
        let entries = eventually("an entry", || async {
            let entries = log.newest(1000).await.expect("reads");
            (entries.len() >= count).then_some(entries)
        })
        .await;
        log.close().await;
        assert_eq!(entries.len(), count, "{entries:#?}");
        entries
    }

    async fn verify(&self, noted: Option<&AuditHead>) -> Result<AuditHead, AuditError> {
        let log = self.log().await;
        let verified = log.verify(noted).await;
        log.close().await;
        verified
    }

    async fn person(&self, name: &str) -> Subject {
        let request = CreateSubjectRequest {
            display_name: name.into(),
            ..<_>::default()
        };
        let made = self.subjects().create_subject(request).await;
        made.expect("is made").into_inner()
    }
}

/// What is told of an entry, but for times and hashes.
fn told(entry: &AuditEntry) -> (&str, &str, Option<u64>, &str) {
    (&entry.call, &entry.names, entry.began, &entry.outcome)
}

const CREATE: &str = "/yoto.v1.SubjectService/CreateSubject";
const DELETE: &str = "/yoto.v1.SubjectService/DeleteSubject";

#[tokio::test]
async fn what_changes_something_is_recorded_before_and_after() {
    let service = Service::start().await;
    let ada = service.person("Ada Lovelace").await;
    let list = ListSubjectsRequest::default();
    service.subjects().list_subjects(list).await.expect("lists");
    service.entries(2).await;
    let delete = |name: &str| DeleteSubjectRequest {
        name: name.into(),
        ..<_>::default()
    };
    let deleted = service.subjects().delete_subject(delete(&ada.name)).await;
    deleted.expect("is deleted");
    service.entries(4).await;
    let again = service.subjects().delete_subject(delete(&ada.name)).await;
    assert_refused(again, Code::NotFound, "NOT_FOUND");
    let entries = service.entries(6).await;
    let found: Vec<_> = entries.iter().map(told).collect();
    let name = ada.name.as_str();
    assert_eq!(
        found,
        [
            (CREATE, "", None, ""),
            (CREATE, name, Some(1), "OK"),
            (DELETE, name, None, ""),
            (DELETE, name, Some(3), "OK"),
            (DELETE, name, None, ""),
            (DELETE, name, Some(5), "NOT_FOUND"),
        ]
    );
    assert!(
        entries
            .iter()
            .all(|it| it.tenant == "default" && it.key.is_empty())
    );
    assert_eq!(
        service.residue("Ada Lovelace").await,
        [""; 0],
        "no texts of callers"
    );
}

#[tokio::test]
async fn old_entries_are_removed_and_the_chain_goes_on() {
    let clock = Arc::new(ManualClock::at(1e9));
    let own = Arc::clone(&clock);
    let service = Service::start_with(|config| {
        config.clock = own;
        config.storage.keep_audit = Some(Duration::from_secs(1000));
        config.storage.collect_interval = Duration::from_millis(50);
    })
    .await;
    service.person("Ada").await;
    service.entries(2).await;
    let early = service.verify(None).await.expect("is whole");
    clock.advance(600.0);
    service.person("Bob").await;
    service.entries(4).await;
    let late = service.verify(None).await.expect("is whole");
    clock.advance(600.0);
    // The first two go, and an entry tells it.
    let entries = eventually("old entries go", || async {
        let log = service.log().await;
        let entries = log.newest(100).await.expect("reads");
        log.close().await;
        (entries.len() == 3).then_some(entries)
    })
    .await;
    assert_eq!(entries[0].number, 3);
    assert_eq!(entries[2].outcome, "REMOVED up to 2");
    let head = service.verify(Some(&late)).await.expect("is whole");
    assert_eq!(head.number, 5);
    let gone = service.verify(Some(&early)).await;
    // The last removed entry is still known by its hash.
    gone.expect("the chain begins after it");
    let before = AuditHead {
        number: 1,
        hash: early.hash.clone(),
    };
    let removed = service.verify(Some(&before)).await;
    assert!(
        matches!(
            removed,
            Err(AuditError::Removed {
                number: 1,
                first: 3
            })
        ),
        "{removed:?}"
    );
}

#[tokio::test]
async fn calls_over_http_and_forms_are_recorded_once() {
    let service = Service::start().await;
    let (address, _serving) = listen(&service).await;
    let json = "content-type: application/json\r\n";
    let made = ask_with(
        address,
        "POST",
        "/v1/subjects",
        json,
        r#"{"displayName":"Ada"}"#,
    )
    .await;
    assert_eq!(made.0, 200, "{made:?}");
    let entries = service.entries(2).await;
    assert_eq!(told(&entries[0]), (CREATE, "", None, ""));
    assert_eq!((entries[1].began, &*entries[1].outcome), (Some(1), "OK"));
    let name = &entries[1].names;
    assert!(made.2.contains(&format!("\"{name}\"")), "{made:?}: {name}");

    // Without the form's token.
    let form = "content-type: application/x-www-form-urlencoded\r\n";
    let refused = ask_with(address, "POST", "/jobs/77/cancel", form, "").await;
    let entries = service.entries(4).await;
    let (call, outcome) = ("POST /jobs/*/cancel", refused.0.to_string());
    assert_eq!(told(&entries[2]), (call, "jobs/77", None, ""));
    assert_eq!(told(&entries[3]), (call, "jobs/77", Some(3), &*outcome));
}

#[tokio::test]
async fn who_called_is_known_by_the_key() {
    let service = Service::start().await;
    let key = service.key("lab", &[Scope::Write]).await;
    service.entries(2).await;
    let channel = service.with_key(&key);
    let mut subjects = yoto_proto::v1::subject_service_client::SubjectServiceClient::new(channel);
    let request = CreateSubjectRequest {
        display_name: "Ada".into(),
        ..<_>::default()
    };
    subjects.create_subject(request).await.expect("is made");
    let entries = service.entries(4).await;
    assert_eq!(entries[2].tenant, "lab");
    assert_eq!(entries[2].key, id(&key.name));

    let keys = match service.database.url() {
        Some(url) => KeyStore::in_postgres(&url).await,
        None => KeyStore::in_folder(service.dir.path()).await,
    };
    let keys = keys.expect("opens");
    let request = CreateKeyRequest {
        display_name: "made on the host".into(),
        scopes: vec![Scope::Read.into()],
        ..<_>::default()
    };
    let made = keys.create(request).await.expect("is made");
    let name = made.key.expect("a key").name;
    keys.revoke(&name).await.expect("is revoked");
    keys.close().await;
    let entries = service.entries(8).await;
    let found: Vec<_> = entries[4..].iter().map(told).collect();
    assert_eq!(
        found,
        [
            ("yoto key create", "", None, ""),
            ("yoto key create", &*name, Some(5), "OK"),
            ("yoto key revoke", &*name, None, ""),
            ("yoto key revoke", &*name, Some(7), "OK"),
        ]
    );
    service.verify(None).await.expect("is whole");
}

#[tokio::test]
async fn what_was_changed_or_taken_away_is_found() {
    let service = Service::start().await;
    let none = service.verify(None).await.expect("is whole");
    assert_eq!(none.number, 0);
    for name in ["Ada", "Ben", "Cleo"] {
        service.person(name).await;
    }
    service.entries(6).await;
    let noted = service.verify(Some(&none)).await.expect("is whole");
    assert_eq!(noted.number, 6);
    service.person("Dora").await;
    service.entries(8).await;
    let head = service.verify(Some(&noted)).await.expect("goes on");
    assert_eq!(head.number, 8);

    let database = &service.database;
    database
        .run("UPDATE audit SET outcome = 'CUT_OFF' WHERE number = 4")
        .await;
    let found = service.verify(None).await.expect_err("was changed");
    assert!(
        matches!(found, AuditError::Broken(Broken::Changed(4))),
        "{found}"
    );
    database
        .run("UPDATE audit SET outcome = 'OK' WHERE number = 4")
        .await;
    service.verify(Some(&head)).await.expect("is as it was");

    database.run("DELETE FROM audit WHERE number > 6").await;
    service.verify(None).await.expect("is whole in itself");
    let found = service.verify(Some(&head)).await.expect_err("was cut");
    assert!(
        matches!(found, AuditError::NotAsNoted { number: 8, .. }),
        "{found}"
    );
    database.run("DELETE FROM audit WHERE number = 2").await;
    let found = service.verify(None).await.expect_err("lacks one");
    let missing = Broken::Missing {
        expected: 2,
        found: 3,
    };
    assert!(matches!(found, AuditError::Broken(it) if it == missing));
}

#[tokio::test]
async fn a_call_that_cant_be_recorded_is_not_carried_out() {
    let service = Service::start().await;
    // No number comes after this one.
    let last =
        "INSERT INTO audit (number, time, tenant, key, call, names, names_sha256, outcome, hash)
         VALUES (9223372036854775807, 0, '', '', '', '', '', '', '')";
    service.database.run(last).await;
    let request = CreateSubjectRequest {
        display_name: "Ada".into(),
        ..<_>::default()
    };
    let refused = service.subjects().create_subject(request).await;
    assert_refused(refused, Code::Unavailable, "STORE_UNAVAILABLE");
    let list = ListSubjectsRequest::default();
    let listed = service.subjects().list_subjects(list).await;
    assert!(listed.expect("reads").into_inner().subjects.is_empty());
    service.database.run("DELETE FROM audit").await;
    service.person("Ada").await;
    service.entries(2).await;
}

#[tokio::test]
async fn an_erasure_takes_the_names_and_leaves_the_chain() {
    let service = Service::start().await;
    let ada = service.person("Ada").await;
    let erase = EraseSubjectRequest {
        name: ada.name.clone(),
        display_name: "Ada".into(),
        ..<_>::default()
    };
    let erasure = service.subjects().erase_subject(erase).await;
    let erasure = erasure.expect("begins").into_inner().name;
    eventually("the report", || async {
        let request = GetErasureRequest {
            name: erasure.clone(),
        };
        let erasure = service.subjects().get_erasure(request).await;
        let state = erasure.expect("is there").into_inner().state();
        (state == erasure::State::Done).then_some(())
    })
    .await;
    let entries = service.entries(4).await;
    assert!(entries.iter().all(|it| !it.names.contains(id(&ada.name))));
    assert_ne!(entries[2].names_sha256, yoto_proto::sha256_hex(b""));
    let head = service.verify(None).await.expect("is whole");
    assert_eq!(head.number, 4);
}

//! Entries of the audit log.

use super::{door, with_key};
use crate::support::{Service, assert_refused};
use tonic::Code;
use yoto_proto::v1::job_service_client::JobServiceClient;
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_proto::v1::{CancelJobRequest, CreateSubjectRequest, Scope};
use yoto_server::AuditLog;

/// More than a key's budget.
const CALLS: usize = 300;

#[tokio::test]
async fn refused_calls_of_a_key_are_listed_within_its_budget_and_then_counted() {
    let service = Service::start_with(|config| config.traffic.refused_calls = 100).await;
    let greedy = service.key("lab", &[Scope::Write]).await;
    let other = service.key("lab", &[Scope::Write]).await;
    let address = door(&service).await;
    let connection = with_key(address, &greedy).await;
    let mut refused = 0;
    for _ in 0..CALLS {
        let request = CancelJobRequest {
            name: "jobs/00000000-0000-0000-0000-000000000000".into(),
            ..CancelJobRequest::default()
        };
        let cancelled = JobServiceClient::new(connection.clone())
            .cancel_job(request)
            .await;
        let status = cancelled.expect_err("there is no such job");
        if status.code() == Code::Unavailable {
            assert_refused::<()>(Err(status), Code::Unavailable, "BUSY");
            refused += 1;
        }
    }
    assert!(refused >= CALLS - 150, "{refused}");
    // Others of the tenant go on, and are listed.
    let create = CreateSubjectRequest {
        display_name: "Ada".into(),
        ..CreateSubjectRequest::default()
    };
    let mut subjects = SubjectServiceClient::new(with_key(address, &other).await);
    subjects.create_subject(create).await.expect("is made");
    // The service writes the numbers at its end, if not before.
    let url = service.database.url();
    let dir = service.stop().await;
    let log = match url {
        Some(url) => AuditLog::in_postgres(&url).await,
        None => AuditLog::in_folder(dir.path()).await,
    };
    let log = log.expect("opens");
    let entries = log.newest(5000).await.expect("reads");
    let counted: Vec<_> = (entries.iter())
        .filter_map(|it| it.outcome.strip_prefix("COUNTED "))
        .map(|it| it.parse::<usize>().expect("a number"))
        .collect();
    assert_eq!(counted.iter().sum::<usize>(), refused, "none is lost");
    let listed = entries
        .iter()
        .filter(|it| it.call.ends_with("CancelJob"))
        .count();
    assert_eq!(listed, 2 * (CALLS - refused));
    log.verify(None).await.expect("the chain is whole");
    log.close().await;
}

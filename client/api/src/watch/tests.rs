//! Watches of a service with scripted connection failures.

use crate::{ClientError, YotoClient};
use std::collections::VecDeque;
use std::sync::Mutex;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::{Code, Request, Response, Status};
use yoto_proto::v1;
use yoto_proto::v1::job_service_server::{JobService, JobServiceServer};
use yoto_proto::v1::{
    CancelJobRequest, CreateJobRequest, DeleteJobRequest, Deleted, GetJobRequest, Job,
    ListJobsRequest, ListJobsResponse, WatchJobRequest, WatchJobResponse, job,
};

/// What one connection sends: the request it expects, and its messages.
type Script = (u64, Vec<Result<Job, Status>>);

struct Scripted(Mutex<VecDeque<Script>>);

type Answer<T> = Result<Response<T>, Status>;
type Answers<T> = tokio_stream::Iter<std::vec::IntoIter<Result<T, Status>>>;

#[tonic::async_trait]
impl JobService for Scripted {
    type WatchJobsStream = Answers<v1::WatchJobsResponse>;

    async fn watch_jobs(&self, _: Request<v1::WatchJobsRequest>) -> Answer<Self::WatchJobsStream> {
        Err(Status::unimplemented("only watching one job is scripted"))
    }
    async fn get_job_metrics(
        &self,
        _: Request<v1::GetJobMetricsRequest>,
    ) -> Answer<v1::JobMetrics> {
        Err(Status::unimplemented("only watching is scripted"))
    }
    async fn retry_job(&self, _: Request<v1::RetryJobRequest>) -> Answer<Job> {
        Err(Status::unimplemented("only watching is scripted"))
    }

    type WatchJobStream = Answers<WatchJobResponse>;

    async fn watch_job(&self, request: Request<WatchJobRequest>) -> Answer<Self::WatchJobStream> {
        let next = self
            .0
            .lock()
            .map_err(|_| Status::aborted("poisoned"))?
            .pop_front();
        let (after, messages) =
            next.ok_or_else(|| Status::not_found("nothing is scripted any more"))?;
        let found = request.into_inner().after_sequence;
        if found != after {
            return Err(Status::invalid_argument(format!(
                "asked for what comes after {found}, not {after}"
            )));
        }
        let answer =
            |message: Result<Job, Status>| message.map(|job| WatchJobResponse { job: Some(job) });
        let messages: Vec<_> = messages.into_iter().map(answer).collect();
        Ok(Response::new(tokio_stream::iter(messages)))
    }

    async fn create_job(&self, _: Request<CreateJobRequest>) -> Answer<Job> {
        Err(Status::unimplemented("only watching is scripted"))
    }
    async fn get_job(&self, _: Request<GetJobRequest>) -> Answer<Job> {
        Err(Status::unimplemented("only watching is scripted"))
    }
    async fn list_jobs(&self, _: Request<ListJobsRequest>) -> Answer<ListJobsResponse> {
        Err(Status::unimplemented("only watching is scripted"))
    }
    async fn cancel_job(&self, _: Request<CancelJobRequest>) -> Answer<Job> {
        Err(Status::unimplemented("only watching is scripted"))
    }
    async fn pause_jobs(
        &self,
        _: Request<v1::PauseJobsRequest>,
    ) -> Result<Response<v1::PauseJobsResponse>, Status> {
        Err(Status::unimplemented("not watched"))
    }

    async fn resume_jobs(
        &self,
        _: Request<v1::ResumeJobsRequest>,
    ) -> Result<Response<v1::ResumeJobsResponse>, Status> {
        Err(Status::unimplemented("not watched"))
    }

    async fn delete_job(&self, _: Request<DeleteJobRequest>) -> Answer<Deleted> {
        Err(Status::unimplemented("only watching is scripted"))
    }
}

async fn client_of(script: Vec<Script>) -> YotoClient {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0")
        .await
        .expect("a free port");
    let address = listener.local_addr().expect("is bound");
    let service = JobServiceServer::new(Scripted(Mutex::new(script.into())));
    let server = tonic::transport::Server::builder().add_service(service);
    tokio::spawn(server.serve_with_incoming(TcpListenerStream::new(listener)));
    YotoClient::connect(&format!("http://{address}"))
        .await
        .expect("connects")
}

fn job(sequence: u64, state: job::State) -> Job {
    Job {
        name: "jobs/1".into(),
        sequence,
        state: state.into(),
        ..Job::default()
    }
}

#[tokio::test]
async fn a_broken_stream_goes_on_after_the_last_sequence() {
    use job::State::{Queued, Running, Succeeded};
    let client = client_of(vec![
        (
            0,
            vec![
                Ok(job(4, Queued)),
                Ok(job(5, Running)),
                Err(Status::unavailable("restarting")),
            ],
        ),
        (5, vec![Err(Status::unavailable("not up yet"))]),
        (5, vec![Ok(job(6, Running))]),
        (6, vec![Ok(job(7, Succeeded))]),
    ])
    .await;
    let mut seen = Vec::new();
    let last = client
        .wait_for_job("jobs/1", |job| seen.push(job.sequence))
        .await
        .expect("succeeds");
    assert_eq!((seen, last.sequence), (vec![4, 5, 6, 7], 7));
}

#[tokio::test]
async fn a_failed_job_and_a_refused_watch_are_errors() {
    let client = client_of(vec![(0, vec![Ok(job(9, job::State::Failed))])]).await;
    let error = client
        .wait_for_job("jobs/1", |_| {})
        .await
        .expect_err("the job failed");
    assert!(matches!(error, ClientError::JobEnded(job) if job.sequence == 9));

    let error = client
        .watch_job("jobs/1")
        .next()
        .await
        .expect_err("nothing is scripted");
    assert!(matches!(error, ClientError::Refused(refusal) if refusal.code() == Code::NotFound));
}

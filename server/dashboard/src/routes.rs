//! The pages: the path of each, the call whose rule it has, and what answers.

use super::asker::Site;
use super::{
    actions, avatar, compare, events, files, job, jobs, model, models, orders, overview, people,
    person, report, service, shares, upload, workers,
};
use axum::routing::{MethodRouter, get, post, put};
use std::sync::{Arc, LazyLock};

/// The page whose answer is a stream.
const EVENTS: &str = "/events";
/// A file of a job, which may be long.
const FILE: &str = "/jobs/{id}/files/{file}";
/// Where the script of a page sends bytes of a file.
const UPLOADED_FILE: &str = "/people/upload/files/{id}/{file}";
/// How the paths of the requests begin by which a page's script sends a person's files.
const OF_SCRIPT: &str = "/people/upload/";

/// What is authorized of a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PageRule {
    /// The path; `*` is any one segment.
    pub pattern: String,
    /// The path of the call of gRPC whose rule the page has: the most that it makes.
    pub call: &'static str,
    /// Whether the answer is a stream or a long file.
    pub lasts: bool,
    /// Whether a request with PUT brings bytes of a file.
    pub takes_file: bool,
    /// Whether only the script of a page asks for it.
    pub of_script: bool,
}

/// A page.
pub(crate) struct Route {
    /// The path, as the router reads it.
    pub path: &'static str,
    call: &'static str,
    /// What answers.
    pub answers: MethodRouter<Arc<Site>>,
}

fn page(path: &'static str, call: &'static str, answers: MethodRouter<Arc<Site>>) -> Route {
    Route {
        path,
        call,
        answers,
    }
}

/// All pages.
pub(crate) fn all() -> Vec<Route> {
    vec![
        page("/", "/yoto.v1.StatusService/GetStatus", get(overview::page)),
        page(
            "/people",
            "/yoto.v1.SubjectService/ListSubjects",
            get(people::page),
        ),
        page(
            "/people/{id}",
            "/yoto.v1.SubjectService/GetSubject",
            get(person::page),
        ),
        page(
            "/people/{id}/avatar",
            "/yoto.v1.JobService/CreateJob",
            post(avatar::make),
        ),
        page(
            "/people/upload/person",
            "/yoto.v1.SubjectService/CreateSubject",
            post(upload::person),
        ),
        page(
            "/people/upload/files",
            "/yoto.v1.UploadService/CreateUpload",
            post(upload::begin),
        ),
        page(
            "/people/upload/files/{id}",
            "/yoto.v1.UploadService/GetUpload",
            get(upload::state),
        ),
        page(
            "/people/upload/files/{id}/{file}",
            "/yoto.v1.UploadService/WriteUpload",
            put(upload::write),
        ),
        page(
            "/people/upload/finish/{id}",
            "/yoto.v1.UploadService/FinishUpload",
            post(upload::finish),
        ),
        page(
            "/people/upload/cancel/{id}",
            "/yoto.v1.SubjectService/DeleteSubject",
            post(upload::cancel),
        ),
        page(
            "/people/upload/cancel-capture/{id}",
            "/yoto.v1.SubjectService/DeleteCapture",
            post(upload::cancel_capture),
        ),
        page(
            "/models",
            "/yoto.v1.ModelService/ListModels",
            get(models::page),
        ),
        page(
            "/models/{id}",
            "/yoto.v1.ModelService/GetModel",
            get(model::page),
        ),
        page(
            "/models/{id}/report.html",
            "/yoto.v1.ModelService/GetModel",
            get(report::page),
        ),
        page(
            "/models/{id}/train",
            "/yoto.v1.JobService/CreateJob",
            post(orders::train),
        ),
        page(
            "/models/{id}/player",
            "/yoto.v1.JobService/CreateJob",
            post(orders::player),
        ),
        page(
            "/models/{id}/film",
            "/yoto.v1.JobService/CreateJob",
            post(orders::film),
        ),
        page(
            "/compare",
            "/yoto.v1.ModelService/GetModel",
            get(compare::page),
        ),
        page("/jobs", "/yoto.v1.JobService/ListJobs", get(jobs::page)),
        page("/jobs/{id}", "/yoto.v1.JobService/GetJob", get(job::page)),
        page(
            "/jobs/{id}/cancel",
            "/yoto.v1.JobService/CancelJob",
            post(actions::cancel),
        ),
        page(
            "/jobs/{id}/retry",
            "/yoto.v1.JobService/RetryJob",
            post(actions::retry),
        ),
        page(
            "/jobs/{id}/share",
            "/yoto.v1.ShareService/CreateShare",
            post(shares::create),
        ),
        page(
            "/shares/{id}/revoke",
            "/yoto.v1.ShareService/RevokeShare",
            post(shares::revoke),
        ),
        page(
            "/jobs/{id}/files/{file}",
            "/yoto.v1.ObjectService/DownloadObject",
            get(files::of_job),
        ),
        page(
            "/captures/{id}/thumbnail.png",
            "/yoto.v1.ObjectService/DownloadObject",
            get(files::thumbnail),
        ),
        page(
            "/workers",
            "/yoto.v1.StatusService/ListWorkers",
            get(workers::page),
        ),
        page(
            "/workers/cordon",
            "/yoto.v1.StatusService/CordonWorker",
            post(actions::cordon),
        ),
        page(
            "/workers/uncordon",
            "/yoto.v1.StatusService/UncordonWorker",
            post(actions::uncordon),
        ),
        page(
            "/service",
            "/yoto.v1.StatusService/GetStatus",
            get(service::page),
        ),
        page(
            "/sign-out",
            "/yoto.v1.StatusService/GetStatus",
            post(actions::sign_out),
        ),
        page(
            "/events",
            "/yoto.v1.JobService/WatchJobs",
            get(events::stream),
        ),
    ]
}

/// The rules of all pages. A path with no rule is not answered.
pub static RULES: LazyLock<Vec<PageRule>> =
    LazyLock::new(|| all().iter().map(Route::rule).collect());

impl Route {
    fn rule(&self) -> PageRule {
        let segments = self.path.split('/').map(|it| match it.starts_with('{') {
            true => "*",
            false => it,
        });
        PageRule {
            pattern: segments.collect::<Vec<_>>().join("/"),
            call: self.call,
            lasts: [EVENTS, FILE].contains(&self.path),
            takes_file: self.path == UPLOADED_FILE,
            of_script: self.path.starts_with(OF_SCRIPT),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn each_page_has_the_rule_of_a_call_and_a_pattern_of_its_own() {
        let mut patterns = HashSet::new();
        for rule in RULES.iter() {
            let call = yoto_request::methods::request(rule.call);
            assert!(call.is_some(), "{rule:?}");
            assert!(patterns.insert(&rule.pattern), "{rule:?}");
        }
        let special = |of: fn(&PageRule) -> bool| RULES.iter().filter(|it| of(it)).count();
        assert_eq!(special(|it| it.lasts), 2);
        assert_eq!(special(|it| it.takes_file), 1);
    }
}

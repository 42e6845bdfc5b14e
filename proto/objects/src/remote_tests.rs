//! A remote store that is not as it should be: at the start, and later.

use super::*;
use bytes::Bytes;
use std::time::Instant;
use yoto_test_s3::{BUCKET, S3Fault, Server, Setup};

type Variables = Vec<(String, String)>;

fn open_at(url: &str, environment: Variables) -> Objects {
    Objects::open_with(&Url::parse(url).expect("a URL"), &environment.into()).expect("opens")
}

fn open(environment: Variables) -> Objects {
    open_at(&format!("s3://{BUCKET}/a"), environment)
}

/// What the check at the start says.
async fn told(objects: &Objects) -> String {
    let checked = objects.check(Rights::All).await;
    let error = checked.expect_err("is not usable");
    assert!(matches!(error, ObjectsError::Unusable { .. }), "{error:?}");
    let text = error.to_string();
    assert!(
        !text.contains('\n') && !text.contains("yoto-test-secret"),
        "{text}"
    );
    text
}

#[tokio::test]
async fn a_good_store_passes_and_nothing_is_left() {
    let server = Server::start();
    let objects = open(server.environment());
    objects.check(Rights::All).await.expect("is good");
    let files = std::fs::read_dir(server.folder().join("a/check"));
    assert_eq!(files.expect("lists").count(), 0);
    server.deny(&["DeleteObjects", "DeleteObject"]);
    objects
        .check(Rights::ReadWrite)
        .await
        .expect("a worker deletes nothing");
}

#[tokio::test]
async fn what_is_missing_or_wrong_is_told_with_what_to_do() {
    let server = Server::start();
    let bucket = open_at("s3://no-such-bucket/a", server.environment());
    assert!(
        told(&bucket)
            .await
            .contains("no bucket 'no-such-bucket': create it")
    );
    let key = open(server.environment_with("AWS_ACCESS_KEY_ID", "OTHER"));
    let secret = open(server.environment_with("AWS_SECRET_ACCESS_KEY", "wrong"));
    assert!(told(&key).await.contains("correct AWS_ACCESS_KEY_ID"));
    assert!(
        told(&secret)
            .await
            .contains("correct AWS_SECRET_ACCESS_KEY")
    );
    let objects = open(server.environment());
    for (operation, right) in [
        ("PutObject", "s3:PutObject"),
        ("GetObject", "s3:GetObject"),
        ("ListObjectsV2", "s3:ListBucket"),
        ("DeleteObjects", "s3:DeleteObject"),
    ] {
        server.deny(&[operation]);
        let text = told(&objects).await;
        assert!(text.contains("allow") && text.contains(right), "{text}");
    }
}

#[tokio::test]
async fn other_clocks_regions_and_servers_are_told() {
    let skewed = Server::start_with(Setup {
        no_skew: true,
        ..Setup::default()
    });
    assert!(
        told(&open(skewed.environment()))
            .await
            .contains("set this machine's clock")
    );
    let server = Server::start();
    let objects = open(server.environment());
    for (status, body, expected) in [
        (
            400,
            "<Error><Code>AuthorizationHeaderMalformed</Code><Region>eu-north-1</Region></Error>",
            "set AWS_REGION=eu-north-1",
        ),
        (
            301,
            "<Error><Code>PermanentRedirect</Code></Error>",
            "set AWS_REGION",
        ),
        (
            403,
            "<Error><Code>ExpiredToken</Code></Error>",
            "renew AWS_SESSION_TOKEN",
        ),
        (404, "<html>no such page</html>", "check AWS_ENDPOINT_URL"),
        (405, "<html>not allowed</html>", "check AWS_ENDPOINT_URL"),
        (200, "<html>welcome</html>", "check AWS_ENDPOINT_URL"),
    ] {
        server.fail(S3Fault::Answer(status, body));
        let text = told(&objects).await;
        assert!(text.contains(expected), "{status}: {text}");
    }
}

#[tokio::test]
async fn certificates_and_plain_text_are_told() {
    let server = Server::start_with(Setup {
        tls: true,
        ..Setup::default()
    });
    let unknown = told(&open(server.environment())).await;
    assert!(
        unknown.contains("not trusted") && unknown.contains("AWS_CA_BUNDLE"),
        "{unknown}"
    );
    let known = open(server.environment_with_authority());
    known
        .check(Rights::All)
        .await
        .expect("the authority is known");
    let plain = Server::start();
    let address = plain
        .environment()
        .into_iter()
        .find(|it| it.0 == "AWS_ENDPOINT_URL");
    let address = address
        .expect("has an address")
        .1
        .replace("http:", "https:");
    let text = told(&open(plain.environment_with("AWS_ENDPOINT_URL", &address))).await;
    assert!(text.contains("does not speak TLS"), "{text}");
}

#[tokio::test]
async fn a_server_that_is_down_is_told() {
    let server = Server::start();
    let objects = open(server.environment());
    drop(server);
    let text = told(&objects).await;
    assert!(
        text.contains("can't be reached") && text.contains("refused"),
        "{text}"
    );
}

#[test]
fn an_environment_shows_names_alone() {
    let environment = Environment::from(Server::start().environment());
    let shown = format!("{environment:?}");
    assert!(
        shown.contains("AWS_SECRET_ACCESS_KEY") && !shown.contains("yoto-test-secret"),
        "{shown}"
    );
}

#[test]
fn credentials_in_a_url_are_refused() {
    for url in [
        "s3://KEY:SECRET@bucket/a",
        "s3://bucket/a?secret_access_key=SECRET",
    ] {
        let error = Objects::open_with(&Url::parse(url).expect("a URL"), &Environment::default());
        let text = error.expect_err("is refused").to_string();
        assert!(text.contains("AWS_SECRET_ACCESS_KEY"), "{text}");
        assert!(
            !text.contains("SECRET@") && !text.contains("=SECRET"),
            "{text}"
        );
    }
}

#[tokio::test]
async fn faults_later_have_their_class() {
    let server = Server::start();
    let objects = open(server.environment());
    let written = objects
        .put("k", Bytes::from_static(b"v"))
        .await
        .expect("put");
    server.fail(S3Fault::Answer(
        404,
        "<Error><Code>NoSuchBucket</Code></Error>",
    ));
    let error = objects.read(&written).await.expect_err("no bucket");
    assert!(
        error.is_refused() && !error.is_torn(),
        "a lost bucket is no lost object: {error:?}"
    );
    server.fail(S3Fault::Answer(404, "<html>no backend</html>"));
    let error = objects.read(&written).await.expect_err("a proxy answers");
    assert!(error.is_unavailable() && !error.is_torn(), "{error:?}");
    server.heal();
    server.deny(&["GetObject"]);
    let began = Instant::now();
    let error = objects
        .clone()
        .patient()
        .read(&written)
        .await
        .expect_err("denied");
    assert!(error.is_refused() && !error.is_unavailable(), "{error:?}");
    assert!(
        began.elapsed() < Duration::from_secs(5),
        "waiting does not help"
    );
    server.deny(&[]);
    server.fail(S3Fault::Unavailable);
    let error = objects.put("k", Bytes::new()).await.expect_err("503");
    assert!(
        error.is_unavailable() && !error.is_torn() && !error.is_refused(),
        "{error:?}"
    );
}

#[tokio::test]
async fn a_server_that_is_away_for_ten_seconds_is_waited_for() {
    let server = Arc::new(Server::start());
    let objects = open(server.environment()).patient();
    server.fail(S3Fault::Unavailable);
    let healing = Arc::clone(&server);
    let heal = tokio::spawn(async move {
        tokio::time::sleep(Duration::from_secs(10)).await;
        healing.heal();
    });
    let written = objects
        .put("k", Bytes::from_static(b"v"))
        .await
        .expect("waits");
    heal.await.expect("heals");
    assert!(server.failed() > 3, "{}", server.failed());
    assert_eq!(objects.read(&written).await.expect("reads"), "v");
}

#[tokio::test]
async fn connections_that_end_within_a_body_cost_a_retry() {
    let server = Server::start();
    let objects = open(server.environment()).patient();
    let bytes: Bytes = (0..5 * write::PART_BYTES / 2).map(|it| it as u8).collect();
    server.fail(S3Fault::CutRequests);
    let written = objects.put("m/weights", bytes.clone()).await.expect("put");
    let cut = server.failed();
    assert!(cut > 0);
    server.fail(S3Fault::CutAnswers);
    assert!(objects.read(&written).await.expect("reads") == bytes);
    let folder = tempfile::tempdir().expect("a folder");
    let copy = folder.path().join("copy");
    objects.copy_to(&written, &copy).await.expect("copies");
    assert!(std::fs::read(copy).expect("reads") == bytes);
    assert!(server.failed() > cut);
    server.fail(S3Fault::Slow(Duration::from_millis(300)));
    assert!(objects.read(&written).await.expect("reads") == bytes);
}

#[tokio::test]
async fn parts_are_aborted_when_the_rest_fails_or_is_not_wanted() {
    let server = Server::start();
    let objects = open(server.environment());
    let bytes = Bytes::from(vec![7; 3 * write::PART_BYTES]);
    server.deny(&["CompleteMultipartUpload"]);
    objects
        .put("m/a", bytes.clone())
        .await
        .expect_err("is not completed");
    server.deny(&["UploadPart"]);
    objects
        .put("m/b", bytes.clone())
        .await
        .expect_err("has no parts");
    server.deny(&[]);
    server.fail(S3Fault::Slow(Duration::from_millis(200)));
    let put = objects.put("m/c", bytes);
    let dropped = tokio::time::timeout(Duration::from_millis(500), put).await;
    dropped.expect_err("takes longer");
    server.heal();
    let began = Instant::now();
    while server.open_uploads() > 0 {
        assert!(began.elapsed() < Duration::from_secs(20), "parts are left");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let nothing = std::fs::read_dir(server.folder().join("a/m"));
    assert!(nothing.is_err() || nothing.is_ok_and(|it| it.count() == 0));
}

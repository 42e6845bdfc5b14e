//! A page in Chromium without a window, driven over the protocol of its developer tools, which needs no library: messages of JSON
//! on a pipe, each with a zero behind it.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Longest wait for anything.
const PATIENCE: Duration = Duration::from_secs(60);
/// The browser; the names of Debian and of others.
const PROGRAMS: [&str; 2] = ["chromium", "google-chrome"];

/// A browser with one page. It ends with this value.
pub(crate) struct Browser {
    process: Child,
    to: ChildStdin,
    from: Receiver<Value>,
    sent: u64,
    session: Option<String>,
    /// Bytes of files that the page has sent, as its requests say.
    pub ranges: Vec<(String, String)>,
    _profile: TempDir,
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// What Chromium says of a question to a page that is being replaced.
const GONE: &str = "navigated or closed";

/// The command that evaluates an expression in the page.
fn evaluation(expression: &str) -> Value {
    json!({"expression": expression, "returnByValue": true, "awaitPromise": true, "userGesture": true})
}

/// The value that an evaluation has found.
fn value(expression: &str, mut found: Value) -> Value {
    assert!(found["exceptionDetails"].is_null(), "{expression}: {found}");
    found["result"]["value"].take()
}

impl Browser {
    /// The browser of this machine; `None` without one, unless `YOTO_TEST_BROWSER` is `required`.
    pub(crate) fn start() -> Option<Self> {
        let runs = |it: &&str| Command::new(it).arg("--version").output().is_ok();
        let Some(program) = PROGRAMS.into_iter().find(runs) else {
            let needed = std::env::var("YOTO_TEST_BROWSER").is_ok_and(|it| it == "required");
            assert!(!needed, "none of {PROGRAMS:?} runs here");
            return None;
        };
        let profile = TempDir::new().expect("a folder");
        // The protocol is on the descriptors 3 and 4.
        let script = "exec \"$@\" 3<&0 4>&1 0</dev/null 1>/dev/null 2>&1";
        let mut process = Command::new("sh")
            .args([
                "-c",
                script,
                "sh",
                program,
                "--headless=new",
                "--no-sandbox",
            ])
            .args(["--disable-dev-shm-usage", "--disable-gpu", "--no-first-run"])
            .arg("--remote-debugging-pipe")
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("a shell");
        let to = process.stdin.take().expect("a pipe");
        let mut answers = BufReader::new(process.stdout.take().expect("a pipe"));
        let (told, from) = channel();
        std::thread::spawn(move || {
            let mut message = Vec::new();
            while answers.read_until(0, &mut message).is_ok_and(|it| it > 0) {
                message.pop();
                let parsed = serde_json::from_slice(&message);
                if told.send(parsed.expect("JSON")).is_err() {
                    return;
                }
                message.clear();
            }
        });
        let mut browser = Self {
            process,
            to,
            from,
            sent: 0,
            session: None,
            ranges: Vec::new(),
            _profile: profile,
        };
        let target = browser.call("Target.createTarget", json!({"url": "about:blank"}));
        let target = json!({"targetId": target["targetId"], "flatten": true});
        let attached = browser.call("Target.attachToTarget", target);
        browser.session = attached["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page.enable", "Network.enable", "DOM.enable"] {
            browser.call(domain, json!({}));
        }
        Some(browser)
    }

    /// The result of a command of the protocol.
    pub(crate) fn call(&mut self, method: &str, params: Value) -> Value {
        let answered = self.answer(method, params);
        answered.unwrap_or_else(|error| panic!("{method}: {error}"))
    }

    /// The result of a command of the protocol, or its error.
    fn answer(&mut self, method: &str, params: Value) -> Result<Value, Value> {
        self.sent += 1;
        let mut message = json!({"id": self.sent, "method": method, "params": params});
        if let Some(session) = &self.session {
            message["sessionId"] = session.as_str().into();
        }
        let text = message.to_string() + "\0";
        self.to.write_all(text.as_bytes()).expect("writes");
        loop {
            let answer = self.from.recv_timeout(PATIENCE);
            let mut answer = answer.unwrap_or_else(|_| panic!("no answer to {method}"));
            if answer["id"] == self.sent {
                return match answer["error"].take() {
                    Value::Null => Ok(answer["result"].take()),
                    error => Err(error),
                };
            }
            let request = &answer["params"]["request"];
            if answer["method"] == "Network.requestWillBeSent" && request["method"] == "PUT" {
                let headers = request["headers"].as_object().into_iter().flatten();
                let mut range = headers.filter(|it| it.0.eq_ignore_ascii_case("content-range"));
                let range = range.next().map_or(String::new(), |it| text_of(it.1));
                self.ranges.push((text_of(&request["url"]), range));
            }
        }
    }

    /// What an expression is in the page.
    pub(crate) fn of(&mut self, expression: &str) -> Value {
        let found = self.call("Runtime.evaluate", evaluation(expression));
        value(expression, found)
    }

    /// The text of the page's first element at `selector`; empty without one.
    pub(crate) fn text(&mut self, selector: &str) -> String {
        text_of(&self.of(&format!(
            "document.querySelector('{selector}')?.textContent ?? ''"
        )))
    }

    /// Waits until the expression is true; the page's text is shown if it never is. A page that goes away while it is asked is asked again.
    pub(crate) fn until(&mut self, expression: &str) {
        let begun = Instant::now();
        let guarded = format!(
            "(() => {{ try {{ return Boolean({expression}); }} catch {{ return false; }} }})()"
        );
        loop {
            match self.answer("Runtime.evaluate", evaluation(&guarded)) {
                Ok(found) => {
                    if value(&guarded, found) == true {
                        return;
                    }
                }
                Err(error) => assert!(text_of(&error["message"]).contains(GONE), "{error}"),
            }
            if begun.elapsed() > PATIENCE {
                let page = self.text("main");
                panic!("never {expression}: {page}");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Opens the page with the form, and waits for its script.
    pub(crate) fn open(&mut self, url: &str) {
        self.call("Page.navigate", json!({"url": url}));
        self.until(
            "document.readyState === 'complete' && !document.querySelector('#add form').hidden",
        );
        self.of("document.getElementById('add').open = true");
    }

    /// Sends the key as a browser does whose user has signed in with it.
    pub(crate) fn sign_in(&mut self, key: &str) {
        let sent = format!("Basic {}", STANDARD.encode(format!("ada:{key}")));
        let headers = json!({"headers": {"Authorization": sent}});
        self.call("Network.setExtraHTTPHeaders", headers);
    }

    /// Drops files and folders of this machine onto the form.
    pub(crate) fn drop_onto_form(&mut self, paths: &[&str]) {
        let place = "(() => { document.getElementById('add').open = true; const it = document.querySelector('.drop');
            it.scrollIntoView(); const { x, y } = it.getBoundingClientRect(); return [x + 20, y + 20]; })()";
        let place = self.of(place);
        for kind in ["dragEnter", "dragOver", "drop"] {
            let data = json!({"items": [], "files": paths, "dragOperationsMask": 1});
            let event = json!({"type": kind, "x": place[0], "y": place[1], "data": data});
            self.call("Input.dispatchDragEvent", event);
        }
    }

    /// Chooses files in the form's field for them.
    pub(crate) fn choose(&mut self, paths: &[String]) {
        let asked = json!({"expression": "document.querySelector('#add [name=files]')"});
        let field = self.call("Runtime.evaluate", asked);
        let id = &field["result"]["objectId"];
        self.call(
            "DOM.setFileInputFiles",
            json!({"files": paths, "objectId": id}),
        );
    }

    /// Writes into the form's field of this name.
    pub(crate) fn write(&mut self, field: &str, text: &str) {
        self.of(&format!(
            "document.querySelector('#add [name={field}]').select()"
        ));
        self.call("Input.insertText", json!({"text": text}));
    }

    /// Presses the form's button with these words.
    pub(crate) fn press(&mut self, words: &str) {
        let pressed = self.of(&format!(
            "[...document.querySelectorAll('#add button')].filter((it) => !it.hidden && it.textContent === '{words}').map((it) => it.click()).length"
        ));
        assert_eq!(pressed, 1, "{words}");
    }

    /// The network from now on: bytes per second that the page can send; 0: none at all.
    pub(crate) fn network(&mut self, upload: Option<u64>) {
        let conditions = json!({
            "offline": upload == Some(0),
            "latency": 0,
            "downloadThroughput": -1,
            "uploadThroughput": upload.map_or(-1, |it| it as i64),
        });
        self.call("Network.emulateNetworkConditions", conditions);
    }
}

fn text_of(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

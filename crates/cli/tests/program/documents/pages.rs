//! Extracts the commands of a page.

/// Commands with placeholders, and the commands that run instead.
const OPEN: [(&str, &str); 16] = [
    ("bokehcam COMMAND", "bokehcam render"),
    // Another name than that of the running stream.
    ("bokehcam stream ... --name desk", "bokehcam stream demo --frames 1 --to null --name other"),
    ("bokehcam stream ...", "bokehcam stream demo --frames 1 --to null"),
    ("bokehcam render ...", "bokehcam render photo.jpg --depth-map depth.png --out any.png"),
    ("IMAGE", "photo.jpg"),
    ("DEPTH", "depth.png"),
    ("METRES", "1.2"),
    ("DAMAGED", "depth.png"),
    ("off|on", "on"),
    ("WxH", "64x36"),
    ("--coc PX", "--coc 4"),
    ("--threads N", "--threads 1"),
    ("[SOURCE]", "demo"),
    ("--like FILE.png", "--like NAME.png"),
    ("--out FILE.png", "--out sentence.png"),
    ("--out DIR", "--out dir/"),
];

/// Returns the commands of a page in order, without comments and with continuation lines joined.
pub fn commands(page: &str) -> Vec<String> {
    find_commands(page, within_sentences)
}

/// Returns the commands of a page's code blocks.
pub fn commands_in_blocks(page: &str) -> Vec<String> {
    find_commands(page, |_| Vec::new())
}

fn find_commands(page: &str, within_sentences: impl Fn(&str) -> Vec<String>) -> Vec<String> {
    let mut commands: Vec<String> = Vec::new();
    let (mut block, mut goes_on, mut sentences) = (None, false, String::new());
    for line in page.lines().map(str::trim_end).chain(["```"]) {
        match (block, line.strip_prefix("```")) {
            (None, Some(language)) => {
                commands.extend(within_sentences(&sentences));
                sentences.clear();
                block = Some(language);
            }
            (None, None) => sentences.extend([line, " "]),
            (Some(_), Some(_)) => block = None,
            (Some("sh"), None) => {
                let code = line.split_once(" # ").map_or(line, |(code, _)| code).trim_end();
                match commands.last_mut().filter(|_| goes_on) {
                    Some(last) => *last += code,
                    None => commands.push(code.to_owned()),
                }
                goes_on = code.ends_with(['\\', '|']);
                if let Some(last) = commands.last_mut().filter(|_| goes_on) {
                    *last = format!("{} ", last.trim_end_matches('\\').trim_end());
                }
            }
            // The command in the systemd user unit.
            (Some(_), None) => {
                let stream = line.strip_prefix("STREAM=\"").and_then(|line| line.strip_suffix('"'));
                commands.extend(stream.map(|stream| format!("bokehcam stream {stream}")));
            }
        }
    }
    commands
}

/// Returns the commands named in sentences. For one without arguments, only its help is tried.
fn within_sentences(text: &str) -> Vec<String> {
    let code = text.split('`').skip(1).step_by(2).filter(|code| code.starts_with("bokehcam "));
    let tried = code.map(|code| {
        let whole = OPEN.iter().fold(code.to_owned(), |code, (open, with)| code.replace(open, with));
        let is_meant = ["stream", "preview", "record", "render", "depth", "plate", "bench", "ctl"];
        match is_meant.contains(&&whole["bokehcam ".len()..]) {
            true => whole + " --help",
            false => whole,
        }
    });
    tried.collect()
}

#[test]
fn commands_are_found_in_pages() {
    let page = "text `bokehcam\nx y` and `x`\n```sh\na b   # why\nc \\\n  d |\n    e\n```\n```toml\nx = 1\n```\n`y`, \
                `bokehcam stream`\n```ini\nSTREAM=\"0 --to z\"\n```\n";
    let found = commands(page);
    assert_eq!(found, ["bokehcam x y", "a b", "c   d |     e", "bokehcam stream --help", "bokehcam stream 0 --to z"]);
}

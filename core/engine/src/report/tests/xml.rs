//! A strict parser of tags; the only knowledge of HTML it has is which elements have no content.

const VOID: [&str; 3] = ["meta", "br", "!DOCTYPE"];

/// Element of a document: its name, its attributes, and the text right after its start tag.
pub struct Element {
    pub name: String,
    pub attributes: Vec<(String, String)>,
    pub text: String,
}

impl Element {
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_str())
    }
}

/// Parses a document; panics if it is not well formed.
pub fn read(document: &str) -> Vec<Element> {
    let mut elements = Vec::new();
    let mut open: Vec<String> = Vec::new();
    let mut rest = document;
    while let Some(start) = rest.find('<') {
        check_text(&rest[..start]);
        rest = &rest[start + 1..];
        let end = tag_end(rest);
        let tag = &rest[..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name), "closed out of order");
            continue;
        }
        let (name, attributes) = start_tag(tag.trim_end_matches('/'));
        let text = rest[..rest.find('<').unwrap_or(0)].to_owned();
        if name == "style" || name == "script" {
            rest = &rest[rest.find(&format!("</{name}>")).unwrap()..];
        }
        if !tag.ends_with('/') && !VOID.contains(&name.as_str()) {
            open.push(name.clone());
        }
        elements.push(Element { name, attributes, text });
    }
    assert!(open.is_empty(), "not closed: {open:?}");
    elements
}

fn tag_end(rest: &str) -> usize {
    let mut quoted = false;
    for (i, c) in rest.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '>' if !quoted => return i,
            '<' => panic!("`<` inside a tag: {}", &rest[..i]),
            _ => {}
        }
    }
    panic!("a tag has no end: {rest}")
}

fn start_tag(tag: &str) -> (String, Vec<(String, String)>) {
    let (name, mut rest) = tag.split_once(' ').unwrap_or((tag, ""));
    let mut attributes: Vec<(String, String)> = Vec::new();
    while name != "!DOCTYPE" && !rest.trim().is_empty() {
        let (key, value) = rest.split_once("=\"").unwrap_or_else(|| panic!("in tag {tag}"));
        let (value, after) = value.split_once('"').unwrap();
        check_text(value);
        assert!(attributes.iter().all(|(k, _)| k != key.trim()), "twice in {tag}");
        attributes.push((key.trim().to_owned(), value.to_owned()));
        rest = after;
    }
    (name.to_owned(), attributes)
}

fn check_text(text: &str) {
    for part in text.split('&').skip(1) {
        let entity = part.split_once(';').map(|(entity, _)| entity);
        assert!(matches!(entity, Some("amp" | "lt" | "gt" | "quot" | "#39")), "bare & in {text}");
    }
}

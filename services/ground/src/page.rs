//! What all of this crate's pages share: one file that needs no script, font or address.

/// The look of a page. A page may add to it.
pub(crate) const STYLE: &str = "\
:root{color-scheme:light}body{margin:0;background:#fff;color:#222;font:16px/1.5 Georgia,'Times New Roman',serif}\
main{max-width:1040px;margin:0 auto;padding:24px 20px 60px}h1{font-size:28px;line-height:1.2;margin:0 0 4px}\
h2{font-size:20px;margin:40px 0 8px;border-bottom:1px solid #ccc}p{max-width:46em}\
table{border-collapse:collapse;font:14px/1.35 sans-serif;margin:8px 0}caption,figcaption{text-align:left;font:14px/1.45 Georgia,serif;max-width:62em}\
caption{padding:0 0 6px}figure{margin:18px 0 28px}figcaption{padding:6px 0 0}\
th,td{padding:4px 8px;border:1px solid #ddd;text-align:left;vertical-align:top}td.n,th.n{text-align:right;white-space:nowrap}\
td small{color:#666}th{background:#f4f4f2;font-weight:600}.side{display:flex;flex-wrap:wrap;gap:12px 16px}\
.wide{overflow-x:auto}svg{max-width:100%;height:auto;display:block}.note{color:#555}dl{font:14px/1.45 sans-serif;display:grid;grid-template-columns:max-content 1fr;gap:2px 14px}\
dt{color:#666}dd{margin:0}b.k{font-family:sans-serif}";

/// A whole page: `title` and `body` stand in it as they are, `more_style` after [`STYLE`].
pub(crate) fn document(title: &str, more_style: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>{title}</title><style>{STYLE}{more_style}</style></head><body><main>\n{body}</main></body></html>\n"
    )
}

/// A picture with words below it.
pub(crate) fn figure(picture: &str, caption: &str) -> String {
    format!("<figure>{picture}<figcaption>{caption}</figcaption></figure>")
}

/// Text that may hold anything, as text of a page or as the value of an attribute in double quotes.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

//! The look of the page: light and dark, wide and narrow.

const STYLE: &str = "\
:root{color-scheme:light dark;--ink:#222;--faint:#666;--line:#ddd;--back:#fff;--box:#f4f4f2;--fine:#009E73;--fair:#B97900;--bad:#D55E00}\
body{margin:0;background:var(--back);color:var(--ink);font:16px/1.5 Georgia,'Times New Roman',serif}\
main{max-width:1180px;margin:0 auto;padding:20px 16px 60px}h1{font-size:27px;line-height:1.2;margin:0 0 10px}\
h2{font-size:20px;margin:36px 0 8px;border-bottom:1px solid var(--line)}p,figcaption{max-width:60em}\
.verdict{border-left:6px solid;padding:10px 14px;margin:12px 0;background:var(--box);font-size:18px}\
.verdict.fine{border-color:var(--fine)}.verdict.fair{border-color:var(--fair)}.verdict.bad{border-color:var(--bad)}\
.sign{font:700 17px sans-serif}tr.fine .sign,.fine>.sign{color:var(--fine)}tr.fair .sign,.fair>.sign{color:var(--fair)}tr.bad .sign,.bad>.sign{color:var(--bad)}\
tr.bad td{font-weight:600}dl{font:14px/1.5 sans-serif;display:grid;grid-template-columns:max-content 1fr;gap:2px 14px}dt,small,.faint{color:var(--faint)}dd{margin:0;overflow-wrap:anywhere}\
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(118px,1fr));gap:8px;margin:14px 0;font-family:sans-serif}\
.tiles div{border:1px solid var(--line);padding:8px 10px}.tiles b{display:block;font-size:20px;font-weight:600}.tiles span{font-size:12px;line-height:1.3;display:block;color:var(--faint)}\
.wide{overflow-x:auto}table{border-collapse:collapse;font:14px/1.35 sans-serif;margin:8px 0}\
th,td{padding:4px 8px;border:1px solid var(--line);text-align:left;vertical-align:top}td.n,th.n{text-align:right;white-space:nowrap}th{background:var(--box);font-weight:600}\
table.bars{width:100%}td small{display:block;font-size:12px;font-weight:400;overflow-wrap:anywhere}\
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,440px),1fr));gap:6px 22px}figure{margin:8px 0 14px;min-width:0}\
figcaption{font:13px/1.4 sans-serif;color:var(--faint)}svg{max-width:100%;height:auto;display:block}\
.key{font:13px/1.5 sans-serif;display:flex;flex-wrap:wrap;gap:2px 14px}.key i{display:inline-block;width:14px;height:4px;border-radius:2px;vertical-align:3px;margin-right:5px}\
details{margin:8px 0}summary{cursor:pointer;font:14px sans-serif}footer{margin-top:44px;color:var(--faint);font:13px sans-serif}\
*{-webkit-print-color-adjust:exact;print-color-adjust:exact}\
@media screen and (prefers-color-scheme:dark){:root{--ink:#ddd;--faint:#a5a9b0;--line:#3a3e44;--back:#16181b;--box:#202327;--fine:#2bc498;--fair:#e6a93a;--bad:#ff8a4d}\
svg text{fill:#ddd}svg [stroke=\"#DDDDDD\"]{stroke:#33373c}svg [stroke=\"#0072B2\"]{stroke:#3a9bdc}svg [stroke=\"#444444\"]{stroke:#bbb}}";

/// A whole page: `title` and `body` stand in it as they are.
pub(super) fn document(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>{title}</title><style>{STYLE}</style></head><body><main>\n{body}</main></body></html>\n"
    )
}

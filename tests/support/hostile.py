"""Names and words that try to be more than that: code, cells, markup, links, formulas, magics, escapes."""

import os

#: A file of this name in the working directory says that code ran.
CANARY = "RAN"
_CODE = f"open('{CANARY}', 'w')"

NAMES = (
    f"a\n```python\n{_CODE}\n```\n",
    f"a\n\n```python\n{_CODE}\n```\n\n# b",
    f"a\r\n```python\r\n{_CODE}\r\n```\r\n",
    f"a\u2028```python\u2028{_CODE}\u2028```\u2028",
    f"a\x0b```python\x0c{_CODE}\x85```",
    "```python",
    "~~~\n<b>x</b>\n~~~",
    f"'); {_CODE}; ('",
    f'"); {_CODE}; ("',
    f"''' + {_CODE} + '''",
    f'""" + {_CODE} + """',
    f"\\'); {_CODE} #",
    "\\",
    "a\\\n",
    f"\n%%python\n{_CODE}",
    f"\n!touch {CANARY}",
    f"%%bash\ntouch {CANARY}",
    f"{{{_CODE}}}",
    f"{{{{ {_CODE} }}}}",
    "{{ cycler.__init__.__globals__ }}",
    "{% include '/etc/passwd' %}",
    "{# x #}",
    "${load}",
    "${title}${facts}",
    "$load $$",
    "<script>window.ran = true</script>",
    "</title><script>window.ran = true</script>",
    "</style><script>window.ran = true</script>",
    "</code></pre></details><script>window.ran = true</script>",
    '"><img src=x onerror="window.ran = true">',
    "<img src=https://example.invalid/a.png>",
    "<iframe src=https://example.invalid/b></iframe>",
    "<link rel=stylesheet href=https://example.invalid/c.css>",
    "<style>@import 'https://example.invalid/d.css'</style>",
    "<base href=https://example.invalid/>",
    '<meta http-equiv="refresh" content="0;url=https://example.invalid/e">',
    "<svg onload='window.ran = true'><script>window.ran = true</script></svg>",
    "<svg><a xlink:href='javascript:window.ran = true'><text>x</text></a></svg>",
    "<math><mtext><img src=x onerror=window.ran=true></mtext></math>",
    "![a](https://example.invalid/f.png)",
    "![a][b]\n\n[b]: https://example.invalid/g.png",
    "[a](javascript:window.ran=true)",
    "<javascript:window.ran=true>",
    "https://example.invalid/h www.example.invalid mailto:a@example.invalid",
    r"$\href{javascript:window.ran=true}{x}$ and $$\unicode{x}$$",
    r"\(\require{html}\) \[x\] \begin{equation}x\end{equation}",
    "=cmd|'/C calc'!A0",
    "a;=cmd|'/C calc'!A0;\t@SUM(1)",
    "\x1b]0;title\x07\x1b[31mred\x1b[0m\u202egnp.exe",
    "caf" + os.fsdecode(b"\xe9") + " &lt;b&gt; &amp;#60; _a_ *b* ~~c~~",
)


def file_name(name, ending):
    """`name` as a file can have it, with an ending."""
    return name.replace("/", "\N{DIVISION SLASH}") + ending
